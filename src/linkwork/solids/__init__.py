"""Solids: mass, mass centre and inertia of simple shapes and of meshes; files of meshes."""
