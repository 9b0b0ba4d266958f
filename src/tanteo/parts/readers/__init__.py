"""Readers of CAD files: STEP, STL, OBJ, PLY, 3MF and others, and repair of meshes."""
