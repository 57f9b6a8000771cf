"""From a rig file to the settings of the core."""
