"""Steps of voltage at a resistor and a capacitor."""
