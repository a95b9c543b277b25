"""World to lane."""
class SurfaceIndex:
    def __init__(self, tables): pass
