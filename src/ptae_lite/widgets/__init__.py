"""What a reader can move or press: panels with sliders, 3-D scenes, buttons that train."""
