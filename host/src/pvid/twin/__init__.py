"""The bit-exact twin of the C core: numpy that `printer` translates from the C, and what plays it over a recording."""
