"""Faces of a part: planes, cylinders, cones, spheres and tori, found in exact geometry or in a mesh."""
