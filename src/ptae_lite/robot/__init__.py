"""NICO's upper body, the table, the motions and the recorder.

`arm` and `inverse` use numpy alone and run everywhere. Only a simulation needs PyBullet, and
`scene` imports it when the first simulation starts.
"""
