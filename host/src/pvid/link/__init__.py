"""The serial link: frames, their codec, ports."""
