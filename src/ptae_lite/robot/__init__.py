"""NICO's upper body, the table, the motions and the recorder.

`arm` and `inverse` are plain numpy and run everywhere; only `scene` and what stands on it needs
PyBullet, which is imported when a simulation starts and not before.
"""
