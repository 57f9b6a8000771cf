"""Keys of the rig file that this mechanism had of its own up to version 0.1, where they are now, and its boards."""

MOVED = {
    "l1": "known.l1",
    "sensor.phi_lsb": "sensor.phi.resolution",
    "sensor.phi_range": "sensor.phi.reach",
    "sensor.phi_zero": "nominal.c",
    "sensor.y_lsb": "sensor.y.resolution",
    "sensor.y_range": "sensor.y.reach",
    "sensor.y_delay": "sensor.y.delay",
    "sensor.y_gain_sd": "sensor.y.gain_sd",
}
"""Key -> key; a range or a resolution of 0 was none."""

RELATIVE = {"l1_sd": ("known_sd.l1", "known.l1")}
"""Key -> key of a value that is no longer relative, and what it was relative to."""

BY_OPTION = {"form": "weak", "core": None, "law": "stationary"}
"""Keys of [identifier] that are options of the command, and the value that says nothing; None: any."""

OF_THE_STRONG_FORM = {
    "sensor.acceleration_range": 0.0,
    "identifier.window_s": 0.0,
    "identifier.differentiator": "savitzky-golay",
    "identifier.degree": 12,
    "identifier.stride": 1,
    "identifier.block": 1,
    "identifier.feedback_hz": 10.0,
    "identifier.divider": 1,
    "identifier.kappa_min": 1e-5,
}
"""Keys and the values that say nothing."""

CHOSEN = ("test_functions", "decimation", "smoothing_s", "pass_hz", "disturbance", "survey", "full_angle", "damping")
"""Keys of [identifier] that an identification has chosen by itself for long; `zero` is estimated always."""

NAMES_OF_BOARD = "kapitza\nsample phi rad\nsample y m\np w 1/s^2\np d1\np d2\np c rad"
"""What a board that names nothing would say (pvid.link.names)."""
