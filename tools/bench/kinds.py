"""The shipped mechanisms of tables and tests that compute for seconds each; a light test takes all, `names()`."""

KINDS = (
    "battery_2rc",  # an integral, hidden coordinates of order one, an output by an algebraic equation; 1 Hz
    "cart_pendulum",  # an offset inside sines
    "dc_motor",  # two rows, corners of a current, dry friction
    "furuta",  # two coordinates with a coupled inertia
    "kapitza",  # an input that is a derivative; a second stage with equations of its own
    "rigid_body",  # three rows of order one that share all parameters
    "two_link_arm",  # eight parameters, two frictions, closed loops
    "two_mass_drive",  # the longest row: a hidden coordinate of order two
)
