"""Long measurements: commands of `./tools/pvid bench` and `./tools/pvid campaign`; not part of the package."""
