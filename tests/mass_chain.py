"""Four carts in a row, each with friction of both kinds, the last one pushed: as many unknowns as the core takes."""

from pvid.model import Model, sgn

model = Model("mass chain")
F = model.input("F", "N", hold="zoh", reach=40)
x = [model.sensor(f"x{n}", "m", resolution=1e-5, reach=2) for n in range(4)]
m = [model.unknown(f"m{n}", "kg", 1.0 + 0.2 * n) for n in range(4)]
k = [model.unknown(f"k{n}", "N/m", 80.0 - 10 * n) for n in range(4)]
c = [model.unknown(f"c{n}", "N*s/m", 2.0 + 0.3 * n) for n in range(4)]
f = [model.unknown(f"f{n}", "N", 0.5 + 0.1 * n) for n in range(4)]
for n in range(4):
    pull = k[n] * (x[n] - x[n - 1] if n else x[n])
    push = F if n == 3 else k[n + 1] * (x[n + 1] - x[n])
    model.equation(m[n] * x[n].d(2) + c[n] * x[n].d() + f[n] * sgn(x[n].d()) + pull - push)
