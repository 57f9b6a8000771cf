"""Long measurements: the commands of `./tools/pvid bench`; not part of the package."""
