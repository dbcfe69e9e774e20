"""dior: from raw multi-camera gait captures to 2D and 3D skeleton labels."""
