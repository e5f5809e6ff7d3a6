"""glTF's and OpenPBR's materials once more, from their descriptions: what no program here evaluates is compared with these.

Each takes the parameters of a `.json` that gonia wrote and 3 x N directions in the axes of the tangent, and gives f, 3 x N:
the mean of both orders of light and view, as gonia has it.
"""
import numpy as np


def half(light, view):
    h = light + view
    return h / np.linalg.norm(h, axis=0)


def power5(cosine):
    return (1 - np.clip(cosine, 0, 1)) ** 5


def ggx(light, view, alpha_t, alpha_b):
    """D V of KHR_materials_anisotropy."""
    h = half(light, view)
    a2 = alpha_t * alpha_b
    f = np.stack([alpha_b * h[0], alpha_t * h[1], a2 * h[2]])
    w2 = a2 / (f * f).sum(axis=0)
    d = a2 * w2 * w2 / np.pi
    length = lambda w: np.sqrt((alpha_t * w[0]) ** 2 + (alpha_b * w[1]) ** 2 + w[2] ** 2)
    return d * 0.5 / (light[2] * length(view) + view[2] * length(light))


def charlie(light, view, alpha):
    h = half(light, view)
    d = (2 + 1 / alpha) * np.maximum(1 - h[2] ** 2, 0) ** (0.5 / alpha) / (2 * np.pi)
    t = (1 - alpha) ** 2
    a, b, c, e, f = ((1 - t) * p + t * q for p, q in [
        (21.5473, 25.3245), (3.82987, 3.32435), (0.19823, 0.16801), (-1.97760, -1.27393), (-4.32054, -4.85967)
    ])
    curve = lambda x: a / (1 + b * x**c) + e * x + f
    shadow = lambda x: np.where(x < 0.5, np.exp(curve(np.minimum(x, 0.5))), np.exp(2 * curve(0.5) - curve(1 - np.maximum(x, 0.5))))
    return d / ((1 + shadow(light[2]) + shadow(view[2])) * 4 * light[2] * view[2])


def charlie_albedo(cosine, alpha):
    """By integration, at every cosine."""
    places = np.linspace(0.02, 1, 40)
    n = 150
    theta, phi = np.meshgrid((np.arange(n) + 0.5) / n * np.pi / 2, (np.arange(n) + 0.5) / n * np.pi)
    view = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)]).reshape(3, -1)
    weight = np.sin(theta).ravel() * view[2] * (np.pi / 2 / n) * (2 * np.pi / n)
    albedo = [
        (charlie(np.array([[np.sqrt(1 - c * c)], [0], [c]]), view, alpha) * weight).sum() for c in places
    ]
    return np.interp(cosine, places, np.minimum(albedo, 1))


def gltf_one(p, light, view):
    h = half(light, view)
    fresnel = lambda f0: f0 + (1 - f0) * power5((light * h).sum(axis=0))
    alpha = p["roughness"] ** 2
    lobe = ggx(light, view, alpha * (1 - p["anisotropy_strength"] ** 2) + p["anisotropy_strength"] ** 2, alpha)
    sheen_alpha = p["sheen_roughness"] ** 2
    colour = np.array(p["sheen_color"])
    e = lambda w: colour.max() * charlie_albedo(w[2], sheen_alpha)
    through = np.minimum(1 - e(view), 1 - e(light))
    base = []
    for c in p["base_color"]:
        dielectric = (1 - p["specular"] * fresnel(0.04)) * c / np.pi + p["specular"] * fresnel(0.04) * lobe
        base.append((1 - p["metallic"]) * dielectric + p["metallic"] * fresnel(c) * lobe)
    below = colour[:, None] * charlie(light, view, sheen_alpha) + through * np.stack(base)
    coat_alpha = p["clearcoat_roughness"] ** 2
    coat = p["clearcoat"] * (0.04 + 0.96 * power5(view[2]))
    return (1 - coat) * below + coat * ggx(light, view, coat_alpha, coat_alpha)


def albedo_fit(x, y, f0):
    """Directional albedo of GGX by the rational fit of MaterialX's mx_ggx_dir_albedo_analytic."""
    k = np.array([
        [0.1003, 0.9345, 1.0, 1.0], [-0.6303, -2.323, -1.765, 0.2281], [9.748, 2.229, 8.263, 15.94],
        [-2.038, -3.748, 11.53, -55.83], [29.34, 1.424, 28.96, 13.08], [-8.245, -0.7684, -7.507, 41.26],
        [-26.44, 1.436, -36.11, 54.9], [19.99, 0.2913, 15.86, 300.2], [-5.448, 0.6286, 33.37, -285.1],
    ])
    terms = np.stack([np.ones_like(x), x, y * np.ones_like(x), x * y, x * x, y * y * np.ones_like(x), x * x * y, x * y * y, (x * y) ** 2])
    r = np.einsum("kn,kc->cn", terms, k)
    a, b = np.clip(r[0] / r[2], 0, 1), np.clip(r[1] / r[3], 0, 1)
    return f0 * a + b


def compensation(x, alpha, f0):
    single = albedo_fit(x, alpha, 1.0)
    return 1 + (f0 + (1 - f0) / 21) * (1 - single) / single


def dielectric(c, n):
    g = np.sqrt(n * n + c * c - 1)
    return 0.5 * ((g - c) / (g + c)) ** 2 * (1 + (((g + c) * c - 1) / ((g - c) * c + 1)) ** 2)


def oren_nayar(p, colour, light, view):
    r = p["base_diffuse_roughness"]
    i, v = light[2], view[2]
    s = (light * view).sum(axis=0) - i * v
    ratio = np.where(s > 0, s / np.maximum(i, v), s)
    c1, c2 = 0.5 - 2 / (3 * np.pi), 2 / 3 - 28 / (15 * np.pi)
    a = 1 / (1 + c1 * r)

    def albedo(c):
        sine = np.sqrt(1 - c * c)
        g = sine * (np.arccos(c) - sine * c) + 2 * (sine / c * (1 - sine**3) - sine) / 3
        return a + r * a * g / np.pi

    mean = a * (1 + c2 * r)
    many = colour**2 * mean / (1 - colour * (1 - mean)) * (1 - albedo(i)) * (1 - albedo(v)) / max(1 - mean, 1e-9)
    return (colour * a * (1 + r * ratio) + many) / np.pi


def zeltner(light, view, y):
    x = view[2]
    s = y * (0.0206607 + 1.58491 * y) / (0.0379424 + y * (1.32227 + y))
    m = y * (-0.193854 + y * (-1.14885 + y * (1.7932 - 0.95943 * y * y))) / (0.046391 + y)
    o = y * (0.000654023 + (-0.0207818 + 0.119681 * y) * y) / (1.26264 + y * (-1.92021 + y))
    albedo = np.exp(-0.5 * ((x - m) / s) ** 2) / (s * np.sqrt(2 * np.pi)) + o
    a = (2.58126 * x + 0.813703 * y) * y / (1 + 0.310327 * x * x + 2.60994 * x * y)
    b = np.sqrt(1 - x) * (y - 1) * y**3 / (0.0000254053 + 1.71228 * x - 1.71506 * x * y + 1.34174 * y * y)
    angle = np.arctan2(view[1], view[0])
    along = light[0] * np.cos(angle) + light[1] * np.sin(angle)
    across = light[1] * np.cos(angle) - light[0] * np.sin(angle)
    o = np.stack([a * along + b * light[2], a * across, light[2]])
    density = o[2] / np.pi * (a / (o * o).sum(axis=0)) ** 2
    return albedo * density / light[2], albedo


def openpbr_one(p, light, view):
    h = half(light, view)
    cos_d = (light * h).sum(axis=0)
    coat, r, rc = p["coat_weight"], p["specular_roughness"], p["coat_roughness"]
    rough = (1 - coat) * r + coat * min(1, 2 * rc**4 + r**4) ** 0.25
    u = 1 - p["specular_roughness_anisotropy"]
    ax = rough**2 * np.sqrt(2 / (1 + u * u))
    ay = u * ax
    ax, ay = min(ax, 1), min(ay, 1)
    mean = np.sqrt(ax * ay)
    ratio = p["specular_ior"] / 1.6
    index = (1 - coat) * p["specular_ior"] + coat * max(ratio, 1 / ratio)
    f0 = ((index - 1) / (index + 1)) ** 2
    x = view[2]
    lobe = ggx(light, view, ax, ay)
    coat_f0 = (0.6 / 2.6) ** 2
    coat_comp = compensation(x, rc**2, coat_f0)
    coat_lobe = dielectric(cos_d, 1.6) * ggx(light, view, rc**2, rc**2) * coat_comp
    k = 1 - (1 - coat_f0) / 1.6**2
    fuzz, fuzz_albedo = zeltner(light, view, p["fuzz_roughness"])
    out = []
    for colour, tint in zip(p["base_color"], p["fuzz_color"]):
        comp = compensation(x, mean, f0)
        below = 1 - albedo_fit(x, mean, f0) * comp
        base = dielectric(cos_d, index) * lobe * comp + below * oren_nayar(p, colour, light, view)
        metal = (colour + (1 - colour) * power5(cos_d)) * lobe * compensation(x, mean, colour)
        base = (1 - p["base_metalness"]) * base + p["base_metalness"] * metal
        base = base * ((1 - coat) + coat * (1 - k) / (1 - colour * k))
        coated = coat * coat_lobe + (1 - coat * albedo_fit(x, rc**2, coat_f0) * coat_comp) * base
        out.append(p["fuzz_weight"] * tint * fuzz + (1 - p["fuzz_weight"] * fuzz_albedo) * coated)
    return np.stack(out)


def mean_of_orders(one):
    return lambda p, light, view: 0.5 * (one(p, light, view) + one(p, view, light))


MODELS = {"gltf": mean_of_orders(gltf_one), "openpbr": mean_of_orders(openpbr_one)}
