"""An Arduino library: library.properties, src/, examples/NAME/NAME.ino."""

from __future__ import annotations

from pvid.base.version import __version__
from pvid.deploy.deployment import Deployment, Files
from pvid.deploy.example import example_files
from pvid.deploy.library import library_files, licence, under
from pvid.deploy.memory import avr_note
from pvid.deploy.readme import readme

_PROPERTIES = """\
name={library}
version={version}
author=pvid
maintainer=pvid
sentence=Identifies the physical parameters of a mechanism while it runs.
paragraph={title}: {parameters}, each with a standard error. Static memory, no dependency.
category=Signal Input/Output
url=
architectures=*
includes={name}_identifier.h
"""

_SKETCH = """\
// Identifies a recorded motion and prints the parameters. Put your sensors in place of {name}_example_sample.
#include <{name}_identifier.h>

#include "{name}_example.h"

static uint32_t tick;

void setup() {{
  Serial.begin(115200);
  const pvid_status status = {begin}();
  if (status != PVID_OK) {{
    Serial.print("the configuration is refused: status ");
    Serial.print((int)status);
    Serial.print(" ");
    Serial.println(pvid_status_text(status));
  }}
}}

void loop() {{
  {type} sample[{upper}_SAMPLES];
  if (tick > {upper}_EXAMPLE_TICKS) {{
    return;
  }}
  // Your rig: wait here for the next period of {upper}_PERIOD_US, then read the sensors into sample.
  if ({name}_example_sample(tick, sample)) {{
    {name}_step(sample);
  }} else {{
    char line[{upper}_EXAMPLE_LINE];
    for (int k = 0; k < {upper}_EXAMPLE_LINES; k++) {{
      Serial.println({name}_example_line(k, line));
    }}
  }}
  tick++;
}}
"""


def sketch(d: Deployment) -> Files:
    """The example's folder."""
    ino = _SKETCH.format(name=d.name, upper=d.upper, begin=d.begin, type=d.sample_type)
    return under(f"examples/{d.name}", {f"{d.name}.ino": ino, **example_files(d)})


def package(d: Deployment) -> Files:
    """Name -> text."""
    steps = [
        f"Copy this folder as `{d.library}` into the folder `libraries` of your sketchbook, or make a .zip of it and "
        "add it under Sketch, Include Library.",
        f"Open File, Examples, {d.library}, {d.name}; upload it; open the serial monitor at 115200 baud.",
    ]
    notes = [
        "Arduino compiles one library of this kind into a sketch; for two mechanisms use `--for amalgamation`.",
        avr_note(d),
    ]
    properties = _PROPERTIES.format(
        library=d.library,
        version=__version__,
        title=d.title,
        name=d.name,
        parameters=", ".join(one.name for one in d.parameters),
    )
    files = library_files(d) | sketch(d) | licence()
    return files | {"library.properties": properties, "README.md": readme(d, "for Arduino", steps, notes)}
