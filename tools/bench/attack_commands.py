"""Command lines of odd words: every command that neither records nor emulates, with its own options."""

from __future__ import annotations

import random

_NUMBERS = (
    *("0", "-0", "1", "-1", "nan", "-inf", "inf", "1e300", "-1e300", "1e-300", "5e-324", "1e9", "1e-9", "3", "0.3"),
    *("1000000000000001", "99999999999999999999999", "1.5", "abc", "", "0x10", "1_000", "٣", " 2 ", "1e", "--"),
)
_NAMES = (
    *("run.csv", "run.toml", "", ".", "..", "/", "/dev/null", "/dev/full", "/proc/x.csv", "/nonexistent/x.csv"),
    *("[/b].csv", "[red].csv", "a b.csv", "q'uo\"te.csv", "new\nline.csv", "ünï-漢字.csv", "-dash.csv", "$a$.csv"),
    *("\x1b[31mred.csv", "%s%n.csv", "a" * 251 + ".csv", "a" * 300 + ".csv", "out.csv", "out.csv.gz", "out.npz"),
    *("out.parquet", "out.toml", "out.png", "out.pgf", "out", "bad\udcff.csv", "x.pvlog", "out.csv/", "\u202egpj.csv"),
)
_HOSTS = (
    *("a..b:80", "é" * 70 + ":80", "[::1", ":", "127.0.0.1:99999", "0.0.0.0:-1", "host", "", "[]:0", "1.2.3.4.5:80"),
    *("http://x", "udp://", "udp://a..b:80", "udp://" + "é" * 70 + ":80", "udp://[::1", "udp://x:0", "teleplot://:"),
)
_PORTS = (
    *("hwgrep://(", "hwgrep://", "socket://:", "socket://a..b:1", "socket://127.0.0.1:1", "spy:///dev/null", "loop:/"),
    *("alt://x?class=zz", "foo://x", "cp2110://x", "rfc2217://127.0.0.1:1", "rfc2217://?", "/dev/null", "/tmp", ""),
    *("run.csv", "/dev/nonexistent", "\x1b[31m", "socket://?logging=x", "rfc2217://x?poll_modem=("),
)
_SETTINGS = (
    *("l1=0.3", "l1=nan", "l1=1e300", "l1=", "=", "l1", "x=1", "sensor.phi_lsb=0", "sensor.phi_lsb=1e-300", "a.b.c=1"),
    *("identifier.form=strong", "identifier.window_s=1e6", "identifier.divider=65535", "nominal.rho2=1e6", "l1=[[[["),
    *("identifier.core=q31", "sample_rate=1e-3", "sample_rate=1e6", 'l1="""', "identifier.full_angle=maybe"),
)
_COLUMNS = (
    *("t=1,phi=2,y=3", "phi=phi:deg", "phi=phi:rev/0", "t=t:1e300", "t=t:1e-300", "y=-y", "y=y:-mm", "t", "=", "a=b=c"),
    *("t=99", "t=0", "phi=y,y=phi", "phi=t", "t=phi", "t=t:nan", "t=t:inf", "phi=phi:", "", "y=y:um,y=y:mm"),
)
_TONES = ("0.005,2.3,0", "nan,1,1", "1e300,1e300,0", "1e-300,1,0", "a,b,c", "1,2", "1,1,1,1", "", "0,0,0", "1,1e9,0")
_CHOICES = ("weak", "strong", "f32", "q31", "f64", "all", "stationary", "linear", "full", "nope", "", "[/x]")

_NUMBER, _NAME, _FLAG = _NUMBERS, _NAMES, ()
_RIG = {"--rig": _NAMES, "--set": _SETTINGS}
_READ = {**_RIG, "--columns": _COLUMNS}

# By command: how many arguments it takes, of which words, and its options.
_COMMANDS: dict[str, tuple[int, tuple[str, ...], dict[str, tuple[str, ...]]]] = {
    "simulate": (
        1,
        _NAME,
        {
            **dict.fromkeys(("--rate", "--noise", "--zero", "--skew", "--l1", "--l2", "--rho2", "--gravity"), _NUMBER),
            **dict.fromkeys(("--tilt", "--damping", "--seed", "--bits"), _NUMBER),
            **{"--tone": _TONES, "--truth": _CHOICES, "--exact": _FLAG, "--rig": _NAME},
        },
    ),
    "identify": (
        1,
        _NAME,
        {**_READ, "--law": _CHOICES, "--form": _CHOICES, "--core": _CHOICES, "--json": _FLAG, "--figure": _NAME},
    ),
    "compare": (1, _NAME, {**_READ, "--law": _CHOICES, "--form": _CHOICES, "--core": _CHOICES, "--on": _PORTS}),
    "tune": (1, _NAME, _READ),
    "design": (
        0,
        (),
        {**_READ, "--run": _NAME, "--tone": _TONES, "--duration": _NUMBER, "--json": _FLAG},
    ),
    "tables": (
        0,
        (),
        {
            **dict.fromkeys(("--points", "--degree", "--stride"), _NUMBER),
            **{"--form": ("weak", "strong", "fir", "x"), "--core": _CHOICES, "--rig": _NAME, "--run": _NAME},
            **{"--name": _NAME, "--difference": _FLAG, "--check": _NAME},
        },
    ),
    "models": (0, (), {"--x": _NUMBER}),
    "log": (
        2,
        _PORTS,
        {"--rig": _NAME, "--web": _HOSTS, "--live": _HOSTS, "--samples": _NUMBER, "--allow-loss": _NUMBER, "-q": _FLAG},
    ),
    "verify": (1, _NAME, {"--rig": _NAME}),
    "export": (1, _NAME, {"--rig": _NAME, "--to": ("csv", "mcap", "npz", "parquet", "xml"), "--out": _NAME}),
    "plot": (1, _NAME, {**_READ, "--out": _NAME}),
    "campaign": (1, _NAME, {"--by": _NAME, "-o": ("",), "--scheduler": _HOSTS, "--rigs": ("0", "-1", "abc")}),
    "schema": (0, (), {"--x": _NUMBER}),
    "nope": (1, _NAME, {}),
    "": (0, (), {}),
}
_GOOD = {"--rig": "run.toml", "--run": "run.csv", "--duration": "3", "--set": "l1=0.3"}


def command_line(draw: random.Random) -> list[str]:
    """One that is right but for a few of its words."""
    name = draw.choice(list(_COMMANDS))
    count, words, options = _COMMANDS[name]
    right = name != "log" and draw.random() < 0.6
    line = [
        name,
        *(("out.csv" if name == "simulate" else "run.csv") if right else draw.choice(words) for _ in range(count)),
    ]
    if name == "simulate":
        line += ["--duration", draw.choice(_NUMBERS) if draw.random() < 0.3 else "3"]
    if name == "log":
        line += ["--duration", "0.05"]
    for option in draw.sample(list(options), min(len(options), draw.choice((0, 1, 1, 2, 3)))):
        line.append(option)
        if options[option]:
            line.append(_GOOD[option] if option in _GOOD and draw.random() < 0.4 else draw.choice(options[option]))
    if name in ("tables", "design") and "--rig" not in line:
        line += ["--rig", "run.toml"]
    if draw.random() < 0.03:
        line.append(draw.choice((*_NUMBERS, *_NAMES, "--nope", "-h", "--version")))
    return line
