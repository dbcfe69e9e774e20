"""dior: from raw multi-camera gait captures to 2D and 3D skeleton labels."""


def __getattr__(name: str) -> str:
    """`dior.__version__`, of the installed package; reading it costs more than importing dior does."""
    if name != "__version__":
        raise AttributeError(f"module 'dior' has no attribute '{name}'")
    from importlib.metadata import version

    return version("dior")
