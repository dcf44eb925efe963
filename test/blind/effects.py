"""What the truth may contain beside the plain pull-up. Each effect acts in the reduced model where it acts in nature.

Each class takes a severity (1: strong, as README.md lists it; 0: exactly nothing) and a generator for what chance
decides. `parameters` is the truth that goes under seal. The names are the project's names of effects; what the project
does not know is called unknown:<what>. The forms are chosen to differ from the textbook's; README.md gives each.
"""

import math

import numpy as np

from reduced_rig import GRAVITY_MPS2, TIME_STEP_S, WATER_DENSITY_KGPM3


class Effect:
    """Does nothing. Subclasses override the places where they act; forces in N, > 0 when they pull the rig down."""

    name = ""

    def __init__(self, severity, rng):
        if severity < 0.0:
            raise ValueError(f"severity = {severity}, must not be negative")
        self.severity = float(severity)
        self.parameters = {}
        self.setup(rng)

    def setup(self, rng):
        """Sets self.parameters, from the severity and chance."""

    def prepare(self, model):
        """May change the field before it floats."""

    def strength(self, model, strength):
        """Strength of the interfaces, Pa."""
        return strength

    def hoist_speed(self, speed_mps, tension_n):
        """Speed of the hoist for the commanded one."""
        return speed_mps

    def suspension(self, time_s, hoist_m, load_n):
        """Offset of the collector from where the hoist has it: x, y, z, m. load_n: without the rig's weight."""
        return np.zeros(3)

    def collector_force(self, time_s, hub_m, speed_mps, acceleration_mps2, model):
        """Force on the collector beside weight, buoyancy and ice."""
        return 0.0

    def change_ice(self, model, time_s, above_net):
        """May take ice away, once per step."""

    def after(self, model, result):
        """May change the tension that the load cell sees."""


class Drainage(Effect):
    """Water in the pores of emerged ice; what is left of it falls with the root of time, 1 - √(t/T)."""

    name = "drainage"

    def setup(self, rng):
        self.parameters = {"held_ratio": 0.3 * self.severity, "duration_s": float(rng.uniform(15.0, 25.0))}

    def after(self, model, result):
        volume = result.components["emerged_m3"]
        gain, previous = np.diff(volume, prepend=0.0), np.concatenate(([0.0], volume[:-1]))
        # Ice that slides off takes its water along.
        kept = np.cumprod(np.where((gain < 0.0) & (previous > 1e-6), volume / np.maximum(previous, 1e-6), 1.0))
        kept = np.maximum(kept, 1e-9)
        age = result.time_s - result.time_s[0]
        left = np.maximum(1.0 - np.sqrt(age / self.parameters["duration_s"]), 0.0)
        water_m3 = kept * np.convolve(np.maximum(gain, 0.0) / kept, left)[:len(volume)]
        result.tension_n += (WATER_DENSITY_KGPM3 * GRAVITY_MPS2 * model.ice.void_fraction
                             * self.parameters["held_ratio"] * water_m3)


class FreezeBonds(Effect):
    """Frozen contacts that snap one by one: a bundle of brittle bonds with Weibull-distributed slips at rupture."""

    name = "freeze_bonds"

    def setup(self, rng):
        self.parameters = {"bond_strength_pa": 300.0 * self.severity, "rupture_slip_m": 0.02, "weibull_shape": 2.5}
        self.rng = rng

    def prepare(self, model):
        self.rupture_m = self.parameters["rupture_slip_m"] * self.rng.weibull(2.5, len(model.slip))

    def strength(self, model, strength):
        return strength + self.parameters["bond_strength_pa"] * (model.slip < self.rupture_m)


class BlockDrop(Effect):
    """Blocks that slide off the rim within a second or two. times_s counts from the start of the record."""

    name = "block_drop"

    def __init__(self, severity, rng, times_s=(15.0,), mass_kg=180.0):
        self.times_s, self.mass_kg = times_s, mass_kg
        super().__init__(severity, rng)

    def setup(self, rng):
        self.parameters = {"drops": [
            {"time_s": float(time), "mass_kg": float(self.mass_kg * self.severity * rng.uniform(0.85, 1.15)),
             "duration_s": float(rng.uniform(0.8, 1.8)), "azimuth_rad": float(rng.uniform(0.0, 2.0 * math.pi))}
            for time in self.times_s]}
        self.patches = {}

    def change_ice(self, model, time_s, above_net):
        for index, drop in enumerate(self.parameters["drops"]):
            share = (time_s - drop["time_s"]) / drop["duration_s"]
            if drop["mass_kg"] == 0.0 or not 0.0 <= share < 1.0:
                continue
            density = model.area * model.ice.unit_weight_npm3 / GRAVITY_MPS2  # kg per m of column
            if index not in self.patches:  # the columns nearest to a spot on the rim, as many as hold twice the mass
                spot = model.rig.radius_m * np.array([math.cos(drop["azimuth_rad"]), math.sin(drop["azimuth_rad"])])
                order = np.argsort(np.where(above_net, np.hypot(*(model.position - spot).T), np.inf))
                needed = np.searchsorted(np.cumsum(model.height[order]) * density, 2.0 * drop["mass_kg"]) + 1
                self.patches[index] = order[:needed]
            patch = self.patches[index]
            rate = drop["mass_kg"] * 6.0 * share * (1.0 - share) / drop["duration_s"]  # kg/s, its integral the mass
            height = model.height[patch]
            model.height[patch] = height * (1.0 - min(rate * TIME_STEP_S / (density * height.sum()), 0.9))


class VesselHeave(Effect):
    """Two lines of swell that beat with each other, with the rise of the crane's tip but not in its encoder."""

    name = "vessel_heave"

    def setup(self, rng):
        self.parameters = {"amplitudes_m": [0.05 * self.severity, 0.03 * self.severity],
                           "periods_s": [float(rng.uniform(6.0, 8.0)), float(rng.uniform(4.0, 5.0))],
                           "phases_rad": rng.uniform(0.0, 2.0 * math.pi, 2).tolist()}

    def suspension(self, time_s, hoist_m, load_n):
        lines = zip(*self.parameters.values())
        return np.array([0.0, 0.0, sum(a * math.sin(2.0 * math.pi * time_s / t + p) for a, t, p in lines)])


class CraneSpeed(Effect):
    """Hydraulic leakage: the hoist loses speed with the root of the pressure, so of the load."""

    name = "crane_speed"

    def setup(self, rng):
        self.parameters = {"loss_ratio_at_12kn": 0.14 * self.severity}

    def hoist_speed(self, speed_mps, tension_n):
        loss = self.parameters["loss_ratio_at_12kn"] * math.sqrt(max(tension_n, 0.0) / 12000.0)
        return speed_mps - math.copysign(min(loss, 1.0) * abs(speed_mps), 1.0)


class PoleTilt(Effect):
    """The pole swings out and part of the way back, along an ellipse."""

    name = "pole_tilt"

    def setup(self, rng):
        self.parameters = {"reach_m": 0.45 * self.severity, "azimuth_rad": float(rng.uniform(0.0, 2.0 * math.pi)),
                           "period_s": float(rng.uniform(50.0, 70.0)), "start_s": 8.0}

    def suspension(self, time_s, hoist_m, load_n):
        p = self.parameters
        turn = 2.0 * math.pi * max(time_s - p["start_s"], 0.0) / p["period_s"]
        along, across = 0.5 * p["reach_m"] * (1.0 - math.cos(turn)), 0.3 * p["reach_m"] * math.sin(turn)
        cosine, sine = math.cos(p["azimuth_rad"]), math.sin(p["azimuth_rad"])
        return np.array([along * cosine - across * sine, along * sine + across * cosine, 0.0])


class CollectorHydrodynamics(Effect):
    """Darcy's and Forchheimer's resistance of the net and the water that moves with it, as far as it is immersed."""

    name = "collector_hydrodynamics"

    def setup(self, rng):
        self.parameters = {"linear_nspm": 2000.0 * self.severity, "quadratic_ns2pm2": 40000.0 * self.severity,
                           "added_mass_kg": 1500.0 * self.severity}

    def collector_force(self, time_s, hub_m, speed_mps, acceleration_mps2, model):
        p, wet = self.parameters, min(max(-hub_m / model.rig.rim_height_m, 0.0), 1.0)
        return wet * (p["linear_nspm"] * speed_mps + p["quadratic_ns2pm2"] * speed_mps * abs(speed_mps)
                      + p["added_mass_kg"] * acceleration_mps2)


class PorosityGradient(Effect):
    """More ice at the bottom than at the top, 1 + g cos(πζ) over the height ζ, with the same mean."""

    name = "porosity_gradient"

    def setup(self, rng):
        self.parameters = {"solid_contrast": 0.5 * self.severity}

    def prepare(self, model):
        model.solid_shape = self.parameters["solid_contrast"]


class ThicknessField(Effect):
    """Thickness as a sum of plane waves of random direction about 1.5 m long."""

    name = "thickness_field"

    def setup(self, rng):
        self.parameters = {"deviation_ratio": 0.12 * self.severity, "length_m": 1.5}
        self.rng = rng

    def prepare(self, model):
        angle, phase = self.rng.uniform(0.0, 2.0 * math.pi, (2, 24))
        wave = 2.0 * math.pi / self.parameters["length_m"] * self.rng.uniform(0.5, 1.5, 24)
        along = model.position @ np.array([np.cos(angle), np.sin(angle)])
        field = np.cos(along * wave + phase).sum(axis=1) / math.sqrt(12.0)
        model.height = np.maximum(model.height * (1.0 + self.parameters["deviation_ratio"] * field), 0.3)


class RateDependence(Effect):
    """Thermally activated slip (Prandtl, Eyring): strength grows with asinh of the slip's speed."""

    name = "rate_dependence"

    def setup(self, rng):
        self.parameters = {"gain_ratio": 0.5 * self.severity, "reference_mps": 0.005}
        self.rate = 0.0

    def strength(self, model, strength):
        self.rate = self.rate + (model.slip_rate - self.rate) * TIME_STEP_S / 0.3
        return strength * (1.0 + self.parameters["gain_ratio"] * np.arcsinh(
            self.rate / self.parameters["reference_mps"]) / math.asinh(10.0))


class Compliance(Effect):
    """A wire rope that stiffens as its strands close: F = k x + k x²/x₁."""

    name = "compliance"

    def setup(self, rng):
        self.parameters = {"softness_mpn": self.severity / 120000.0, "closing_m": 0.2}
        self.load_n = 0.0

    def suspension(self, time_s, hoist_m, load_n):
        self.load_n += (load_n - self.load_n) * TIME_STEP_S / 0.8  # slow, for the plug's inertia is in the load too
        closing = self.parameters["closing_m"]
        stretch = self.parameters["softness_mpn"] * max(self.load_n, 0.0)
        return np.array([0.0, 0.0, -0.5 * closing * (math.sqrt(1.0 + 4.0 * stretch / closing) - 1.0)])


class Refreezing(Effect):
    """Contacts at rest gain cohesion with the logarithm of time and lose it at once when they slip on."""

    name = "refreezing"

    def setup(self, rng):
        self.parameters = {"gain_pa": 100.0 * self.severity, "time_s": 4.0, "break_slip_m": 0.015}
        self.wait, self.rested, self.rate = 0.0, 0.0, 0.0

    def strength(self, model, strength):
        self.rate = self.rate + (model.slip_rate - self.rate) * TIME_STEP_S / 0.3
        broken = model.slip - self.rested > self.parameters["break_slip_m"]
        self.wait = np.where(broken, 0.0, self.wait + TIME_STEP_S * (self.rate < 1e-3))
        self.rested = np.where(broken, model.slip, self.rested)
        return strength + self.parameters["gain_pa"] * np.log1p(self.wait / self.parameters["time_s"])


def empty_tension(model):
    """Tension with the empty rig hanging in the water, N: what the cell was zeroed with."""
    return model.rig.mass_kg * GRAVITY_MPS2 - model.rig_buoyancy_n(model.start_height_m)


class LoadCellBias(Effect):
    """A zero that shifted after zeroing."""

    name = "load_cell_bias"

    def setup(self, rng):
        self.parameters = {"bias_n": 900.0 * self.severity}

    def after(self, model, result):
        result.tension_n += self.parameters["bias_n"]


class LoadCellDrift(Effect):
    """Creep of the cell's glue: the zero moves with the logarithm of time."""

    name = "load_cell_drift"

    def setup(self, rng):
        self.parameters = {"drift_n_at_60s": 1200.0 * self.severity, "time_s": 8.0}

    def after(self, model, result):
        time = self.parameters["time_s"]
        result.tension_n += (self.parameters["drift_n_at_60s"] * np.log1p(result.time_s / time)
                             / math.log1p(60.0 / time))


class LoadCellScale(Effect):
    """A gain error that saturates: (1 + s) at no load, a little less at full load."""

    name = "load_cell_scale"

    def setup(self, rng):
        self.parameters = {"scale_error_ratio": 0.2 * self.severity, "bend_per_n": 1e-5}

    def after(self, model, result):
        load = result.tension_n - empty_tension(model)
        result.tension_n += self.parameters["scale_error_ratio"] * load * (1.0 - self.parameters["bend_per_n"] * load)


class LoadCellLag(Effect):
    """A second-order filter, critically damped; lag_s is its whole delay."""

    name = "load_cell_lag"

    def setup(self, rng):
        self.parameters = {"lag_s": 1.5 * self.severity}

    def after(self, model, result):
        if self.parameters["lag_s"] > 0.0:
            share = 1.0 - math.exp(-(result.time_s[1] - result.time_s[0]) / (0.5 * self.parameters["lag_s"]))
            first = second = result.tension_n[0]
            for row, tension in enumerate(result.tension_n):
                first += share * (tension - first)
                second += share * (first - second)
                result.tension_n[row] = second


class DrumRipple(Effect):
    """An eccentric sheave: the tension that arrives at the cell swings with each turn of it, in proportion."""

    name = "unknown:drum_ripple"

    def setup(self, rng):
        self.parameters = {"ratio": 0.08 * self.severity, "turn_m": float(rng.uniform(0.15, 0.25))}

    def after(self, model, result):
        travel = result.hoist_position_m - result.hoist_position_m[0]
        result.tension_n *= 1.0 + self.parameters["ratio"] * np.sin(2.0 * math.pi * travel / self.parameters["turn_m"])


class StickSlip(Effect):
    """Sawtooth over travel: the plug's wall catches, and lets go after a random distance."""

    name = "unknown:stick_slip"

    def setup(self, rng):
        self.parameters = {"force_n": 3000.0 * self.severity, "distances_m": rng.uniform(0.06, 0.16, 100).tolist()}

    def after(self, model, result):
        travel = np.abs(np.diff(result.hoist_position_m, prepend=result.hoist_position_m[0])).cumsum()
        edges = np.concatenate(([0.0], np.cumsum(self.parameters["distances_m"])))
        tooth = np.searchsorted(edges, travel, side="right") - 1
        # The wall is there only as long as the plug has not left the water.
        wall = np.clip(-result.components["hub_m"] / (-model.start_height_m), 0.0, 1.0)
        result.tension_n += self.parameters["force_n"] * wall * (travel - edges[tooth]) / 0.16


class RopeCreep(Effect):
    """Turns of the rope settle into the drum under load: the collector sags in jerks that no encoder sees."""

    name = "unknown:rope_creep"

    def setup(self, rng):
        self.parameters = {"jerks_m": (self.severity * rng.uniform(0.02, 0.05, 6)).tolist(),
                           "times_s": np.sort(rng.uniform(10.0, 34.0, 6)).tolist()}

    def suspension(self, time_s, hoist_m, load_n):
        p = self.parameters
        return np.array([0.0, 0.0, -sum(j * min(max((time_s - t) / 1.2, 0.0), 1.0)
                                        for j, t in zip(p["jerks_m"], p["times_s"]))])


class WaveSlap(Effect):
    """Short waves hit the net from below while it is near the surface."""

    name = "unknown:wave_slap"

    def setup(self, rng):
        self.parameters = {"force_n": 3000.0 * self.severity, "times_s": np.cumsum(rng.uniform(1.2, 2.6, 60)).tolist(),
                           "duration_s": 0.5}

    def after(self, model, result):
        p, near = self.parameters, np.exp(-(result.components["hub_m"] / 0.4)**2)
        for time in p["times_s"]:
            share = np.clip((result.time_s - time) / p["duration_s"], 0.0, 1.0)
            result.tension_n -= p["force_n"] * near * np.sin(math.pi * share)


class CrewStepping(Effect):
    """Somebody leans on the pole now and then to steady it."""

    name = "unknown:crew_stepping"

    def setup(self, rng):
        times = np.cumsum(rng.uniform(1.5, 5.0, 30))
        self.parameters = {"force_n": 800.0 * self.severity, "times_s": times.tolist()}

    def after(self, model, result):
        leans = np.searchsorted(self.parameters["times_s"], result.time_s) % 2
        result.tension_n += self.parameters["force_n"] * np.convolve(leans, np.ones(15) / 15.0, mode="same")


class HullSnag(Effect):
    """The plug catches on the ship's side, is held back like by a spring, and comes free with a jerk."""

    name = "unknown:hull_snag"

    def setup(self, rng):
        self.parameters = {"stiffness_npm": 12000.0 * self.severity, "from_m": float(rng.uniform(-0.9, -0.7)),
                           "length_m": 0.25}

    def after(self, model, result):
        travel = result.components["hub_m"] - self.parameters["from_m"]
        caught = (travel > 0.0) & (travel < self.parameters["length_m"])
        result.tension_n += np.where(caught, self.parameters["stiffness_npm"] * travel, 0.0)


ALL = [Drainage, FreezeBonds, BlockDrop, VesselHeave, CraneSpeed, PoleTilt, CollectorHydrodynamics, PorosityGradient,
       ThicknessField, RateDependence, Compliance, Refreezing, DrumRipple, StickSlip, RopeCreep, WaveSlap, CrewStepping,
       HullSnag, LoadCellBias, LoadCellDrift, LoadCellScale, LoadCellLag]
