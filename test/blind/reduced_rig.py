"""A reduced model of the pull-up test, written without a look at the simulator's code: it makes the truth that the
identification is tested against.

The field is a floor of vertical ice columns on a jittered hexagonal packing. Each column moves only up and down, as one
piece, with its own weight and buoyancy. Neighbours rub on each other where they overlap (Mohr-Coulomb with Krynine's
wall pressure, cohesion lost by slip). The net of the collector pushes the columns above it from below; ice that stands
too steep above the water slides down to the lower neighbour. Nothing in it is fitted to a curve; the few free numbers
are fields of Rig and Ice. README.md has the equations and their sources. SI units; heights over the still waterline.
"""

import math
from dataclasses import dataclass, field

import numpy as np

GRAVITY_MPS2 = 9.81
WATER_DENSITY_KGPM3 = 1000.0
TIME_STEP_S = 0.01
SAMPLE_STEPS = 2  # a record has the mean of so many steps per row: 50 Hz
PRESSURE_MEMORY_S = 0.1  # lag of the confining pressure behind the net's force, so that the step stays explicit
WARM_UP_STEPS = 300  # before time 0, in which what moves the collector beside the hoist comes up
SLIDE_STEPS = 5  # ice slides down slopes once in so many steps
SLIDE_SHARE = 0.08  # share of the excess height that slides each time: half of it within 0.4 s
CONTACT_SHARE = 0.2  # share of the wanted change of a column's speed that the net gives it in one step
CONTACT_TIME_S = 0.05  # in which the net's push would undo a dent
REACH_UNDER_M = 0.2  # a column that stands deeper in the net's way is beside the net, not above it
MIN_THICKNESS_M = 1e-6


@dataclass
class Ice:
    """The brash ice. Ranges: void_fraction in (0, 1); all others > 0, friction_angle_deg < 75."""

    thickness_m: float = 1.2
    void_fraction: float = 0.6
    cohesion_pa: float = 200.0
    friction_angle_deg: float = 50.0
    density_kgpm3: float = 900.0  # of the solid ice

    def __post_init__(self):
        rules = {
            "thickness_m": (0.0, 20.0), "void_fraction": (0.0, 1.0), "cohesion_pa": (0.0, 1e6),
            "friction_angle_deg": (0.0, 75.0), "density_kgpm3": (0.0, WATER_DENSITY_KGPM3)}
        for key, (low, high) in rules.items():
            if not low < getattr(self, key) < high:
                raise ValueError(f"ice.{key} = {getattr(self, key)}, must lie in ({low:g}, {high:g})")

    @property
    def unit_weight_npm3(self):
        """Weight of dry brash ice per volume, voids included."""
        return self.density_kgpm3 * (1.0 - self.void_fraction) * GRAVITY_MPS2


@dataclass
class Rig:
    """Collector, pole, and the free numbers of the columns."""

    radius_m: float = 1.3  # circumradius of the octagon
    rim_height_m: float = 0.3
    mass_kg: float = 240.0  # with the pole
    displaced_volume_m3: float = 0.02
    pole_radius_m: float = 0.05
    lost_edge_m: float = 0.08  # ice whose middle is nearer than this to the rim rolls off it
    field_radius_m: float = 3.0
    spacing_m: float = 0.2
    jitter_ratio: float = 0.15  # of positions, in spacings
    strength_spread: float = 0.2  # standard deviation of ln(cohesion) between interfaces
    mobilisation_m: float = 0.012  # slip at which an interface of reference_strength_pa yields
    reference_strength_pa: float = 500.0
    weakening_slip_m: float = 0.1  # slip after which only the residual cohesion is left
    residual_cohesion_ratio: float = 0.08


def wall_pressure_ratio(friction_angle_deg):
    """Krynine's ratio of horizontal to vertical stress at a wall that is itself a slip plane (no unit)."""
    sine = math.sin(math.radians(friction_angle_deg))
    return (1.0 - sine**2) / (1.0 + sine**2)


def stable_slope(cohesion_pa, friction_angle_deg, unit_weight_npm3, height_m):
    """Tangent of the steepest slope of that height that stands, by Culmann's plane failure (no unit)."""
    phi = math.radians(friction_angle_deg)
    low, high = phi, math.radians(89.0)
    for _ in range(60):
        beta = 0.5 * (low + high)
        standing_m = 4.0 * cohesion_pa * math.sin(beta) * math.cos(phi) / (
            unit_weight_npm3 * max(1.0 - math.cos(beta - phi), 1e-15))
        low, high = (beta, high) if standing_m > height_m else (low, beta)
    return math.tan(low)


def hexagonal_packing(radius_m, spacing_m, jitter_ratio, rng):
    """Positions (n, 2) in a circle, index pairs (m, 2) of neighbours, and the area of a column (m²)."""
    rows = int(radius_m / (spacing_m * math.sqrt(0.75))) + 1
    cells = {}
    for row in range(-rows, rows + 1):
        for column in range(-2 * rows, 2 * rows + 1):
            x, y = spacing_m * (column + 0.5 * row), spacing_m * math.sqrt(0.75) * row
            if math.hypot(x, y) <= radius_m:
                cells[row, column] = (len(cells), x, y)
    pairs = [(index, cells[row + dr, column + dc][0])
             for (row, column), (index, _, _) in cells.items()
             for dr, dc in ((0, 1), (1, 0), (1, -1)) if (row + dr, column + dc) in cells]
    position = np.array([(x, y) for _, x, y in cells.values()])
    angle, offset = rng.uniform(0.0, 2.0 * math.pi), rng.uniform(-0.5, 0.5, 2) * spacing_m
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    position = position @ turn.T + offset + rng.uniform(-1.0, 1.0, position.shape) * jitter_ratio * spacing_m
    return position, np.array(pairs), math.sqrt(0.75) * spacing_m**2


@dataclass
class Result:
    """What a lift gave. All arrays have a row per sample; forces in N, tension > 0 when the rig pulls down."""

    time_s: np.ndarray
    tension_n: np.ndarray  # of the rope, before the sensor
    hoist_position_m: np.ndarray  # what an encoder on the hoist reads, as height of the hub
    hoist_speed_mps: np.ndarray
    hoist_command_mps: np.ndarray
    lateral_n: np.ndarray  # (n, 2)
    components: dict = field(default_factory=dict)


class PullUp:
    """One field, one rig, one lift. Effects are objects of effects.py; see there for what they may change."""

    def __init__(self, ice, seed, rig=None, effects=()):
        self.ice, self.rig, self.effects = ice, rig or Rig(), list(effects)
        rig, rng = self.rig, np.random.default_rng(seed)
        self.position, pairs, self.area = hexagonal_packing(rig.field_radius_m, rig.spacing_m, rig.jitter_ratio, rng)
        self.left, self.right = pairs.T.copy()
        count = len(self.position)
        self.width = rig.spacing_m / math.sqrt(3.0)  # of an interface: the side of a hexagon
        self.height = np.full(count, ice.thickness_m) * (1.0 + 0.01 * rng.standard_normal(count))
        self.cohesion = ice.cohesion_pa * np.exp(rig.strength_spread * rng.standard_normal(len(pairs)))
        self.cohesion *= ice.cohesion_pa / self.cohesion.mean()
        self.solid_shape = 0.0  # see solid_below
        self.stiffness = rig.reference_strength_pa / rig.mobilisation_m  # Pa per m of slip
        self.friction = wall_pressure_ratio(ice.friction_angle_deg) * math.tan(math.radians(ice.friction_angle_deg))
        self.slope = stable_slope(ice.cohesion_pa * rig.residual_cohesion_ratio, ice.friction_angle_deg,
                                  ice.unit_weight_npm3, max(ice.thickness_m - rig.rim_height_m, 0.1))
        self.fixed = np.hypot(*self.position.T) > rig.field_radius_m - rig.spacing_m
        self.slip = np.zeros(len(pairs))  # total plastic slip, m
        self.slip_rate = np.zeros(len(pairs))  # m/s
        self.shift = np.zeros(len(pairs))  # elastic part of the slip, m
        self.net_offset = None  # what net() last worked out
        for effect in self.effects:
            effect.prepare(self)
        self.freeboard = self.height * (1.0 - self.draft_ratio())
        self.base = self.freeboard - self.height
        # Height of the hub at the start, where the net touches the lowest ice above it.
        above_net, net_height = self.net(0.0, np.zeros(2))
        self.start_height_m = float(np.min((self.base - net_height)[above_net]))

    def solid_below(self, share):
        """Solid ice in the lowest `share` of a column over all of it; with solid_shape g: share + g sin(π share)/π."""
        if self.solid_shape == 0.0:
            return share
        return share + self.solid_shape * np.sin(np.pi * share) / np.pi

    def draft_ratio(self):
        """Submerged share of a floating column."""
        low, high = 0.0, 1.0
        for _ in range(60):
            share = 0.5 * (low + high)
            low, high = ((share, high) if self.solid_below(share) < self.ice.density_kgpm3 / WATER_DENSITY_KGPM3
                         else (low, share))
        return low

    def net(self, hub_m, offset_m):
        """Which columns are above the net, and the net's height under each of them."""
        if self.net_offset is None or (offset_m != self.net_offset).any():
            angles = (np.arange(8) + 0.5) * math.pi / 4.0
            reach = np.max((self.position - offset_m) @ np.array([np.cos(angles), np.sin(angles)]), axis=1)
            side = self.rig.radius_m * math.cos(math.pi / 8.0)
            self.net_offset, self.net_ratio, self.net_covers = offset_m, reach / side, (
                reach <= side - self.rig.lost_edge_m)
        return self.net_covers, hub_m + self.rig.rim_height_m * self.net_ratio

    def rig_buoyancy_n(self, hub_m):
        """Of collector and pole, > 0 up."""
        wet = min(max(-hub_m / max(self.rig.rim_height_m, 1e-3), 0.0), 1.0)
        pole_m3 = math.pi * self.rig.pole_radius_m**2 * max(-hub_m, 0.0)
        return WATER_DENSITY_KGPM3 * GRAVITY_MPS2 * (self.rig.displaced_volume_m3 * wet + pole_m3)

    def interface_strength(self, pressure, confined):
        """Shear strength of each interface, Pa.

        pressure is the mean vertical stress of each column, Pa; confined the share of each interface below the field's
        surface, above which nothing outside the plug holds against its pushing sideways.
        """
        rig = self.rig
        kept = rig.residual_cohesion_ratio + (1.0 - rig.residual_cohesion_ratio) * np.maximum(
            1.0 - self.slip / rig.weakening_slip_m, 0.0)
        strength = self.cohesion * kept + self.friction * confined * 0.5 * (
            pressure[self.left] + pressure[self.right])
        for effect in self.effects:
            strength = effect.strength(self, strength)
        return strength

    def slide(self, above_net):
        """Ice that stands steeper than the slope, above the water and above what carries it, moves to the neighbour."""
        top = self.base + self.height
        down = top[self.left] > top[self.right]
        donor, receiver = np.where(down, self.left, self.right), np.where(down, self.right, self.left)
        carried = np.maximum(np.maximum(top[receiver], 0.0), np.where(above_net[donor], self.base[donor], -np.inf))
        excess = SLIDE_SHARE * np.maximum(top[donor] - carried - self.slope * self.rig.spacing_m, 0.0)
        given = np.bincount(donor, excess, len(top))
        scale = np.minimum(1.0, np.maximum(self.height - MIN_THICKNESS_M, 0.0) / np.maximum(given, MIN_THICKNESS_M))
        excess *= scale[donor]
        self.height += np.bincount(receiver, excess, len(top)) - np.bincount(donor, excess, len(top))

    def run(self, command_mps, empty=False):
        """Lifts with the hoist command (m/s, one value per TIME_STEP_S). empty: no ice at all."""
        ice, rig, dt = self.ice, self.rig, TIME_STEP_S
        steps = len(command_mps) // SAMPLE_STEPS * SAMPLE_STEPS
        names = ("tension_n hoist_position_m hoist_speed_mps hoist_command_mps lateral_x_n lateral_y_n weight_n"
                 " buoyancy_n ice_n inertia_n effect_n emerged_m3 hub_m").split()
        log = np.empty((steps, len(names)))
        count = len(self.position)
        speed, pressure = np.zeros(count), np.zeros(count)
        solid = ice.density_kgpm3 * (1.0 - ice.void_fraction) * self.area  # kg per m of column
        lift = WATER_DENSITY_KGPM3 * (1.0 - ice.void_fraction) * self.area  # the same for the water it pushes aside
        hoist, load, hub_speed = self.start_height_m, 0.0, 0.0
        hub = hoist
        weight = rig.mass_kg * GRAVITY_MPS2
        field_top = ice.thickness_m * (1.0 - self.draft_ratio())
        for step in range(-WARM_UP_STEPS, steps):
            time = step * dt
            command = hoist_speed = command_mps[step] if step >= 0 else 0.0
            for effect in self.effects:
                hoist_speed = effect.hoist_speed(hoist_speed, weight + load)
            hoist += hoist_speed * dt
            offset = np.zeros(3)
            for effect in self.effects:
                offset += effect.suspension(time, hoist, load) * min(1.0 + step / WARM_UP_STEPS, 1.0)
            new_hub_speed = (hoist + offset[2] - hub) / dt
            hub, acceleration, hub_speed = hoist + offset[2], (new_hub_speed - hub_speed) / dt, new_hub_speed
            ice_force, emerged_m3 = 0.0, 0.0
            if not empty:
                above_net, net_height = self.net(hub, offset[:2])
                wet = np.minimum(np.maximum(-self.base, 0.0), self.height)
                sunk = self.height * self.solid_below(wet / self.height)
                own = GRAVITY_MPS2 * (lift * sunk - solid * self.height)
                # Vertical stress rises from the net's pressure to the weight above the water, then falls to none.
                dry_stress = ice.unit_weight_npm3 * (self.height - wet)
                mean_stress = (wet * (pressure + dry_stress) + (self.height - wet) * dry_stress) / (2.0 * self.height)
                top = self.base + self.height
                low = np.maximum(self.base[self.left], self.base[self.right])
                high = np.minimum(top[self.left], top[self.right])
                overlap = np.maximum(high - low, 0.0)
                confined = np.minimum(np.maximum(field_top - low, 0.0) / np.maximum(overlap, MIN_THICKNESS_M), 1.0)
                strength = self.interface_strength(mean_stress, confined)
                sliding = speed[self.left] - speed[self.right]
                trial = self.shift + sliding * dt
                self.shift = np.minimum(np.maximum(trial, -strength / self.stiffness), strength / self.stiffness)
                self.slip_rate = np.abs(trial - self.shift) / dt
                self.slip += np.abs(trial - self.shift)
                shear = self.stiffness * (self.shift + 2.0 * dt * sliding)
                shear = np.minimum(np.maximum(shear, -strength), strength) * overlap * self.width
                force = own - np.bincount(self.left, shear, count) + np.bincount(self.right, shear, count)
                # The pore water moves along as long as it is under water.
                mass = solid * self.height + WATER_DENSITY_KGPM3 * ice.void_fraction * self.area * wet
                mass = np.maximum(mass, 2.0)  # a column that has all slid away must not outrun the time step
                free = speed + dt * (force - 0.3 * mass * speed) / mass
                free[self.fixed] = 0.0
                dent = net_height - self.base
                above_net = above_net & (dent < REACH_UNDER_M)
                wanted = hub_speed + dent / CONTACT_TIME_S
                change = np.where(above_net & (dent > 0.0), CONTACT_SHARE * np.maximum(wanted - free, 0.0), 0.0)
                reaction = mass * change / dt
                speed = free + change
                self.base += speed * dt
                pressure += (reaction / self.area - pressure) * dt / PRESSURE_MEMORY_S
                ice_force = reaction.sum()
                emerged_m3 = self.area * (np.maximum(self.height - wet - self.freeboard, 0.0) * (pressure > 0.0)).sum()
                if step % SLIDE_STEPS == 0:
                    self.slide(above_net)
                for effect in self.effects:
                    effect.change_ice(self, time, above_net)
            extra = sum(effect.collector_force(time, hub, hub_speed, acceleration, self) for effect in self.effects)
            buoyancy, inertia = self.rig_buoyancy_n(hub), rig.mass_kg * acceleration
            pull = ice_force + extra
            load += (pull - load) * dt / PRESSURE_MEMORY_S
            tension = weight - buoyancy + pull + inertia
            tilt = offset[:2] / 6.0  # the pole's length
            if step >= 0:
                log[step] = (tension, hoist, hoist_speed, command, *(tension * tilt), weight, buoyancy, ice_force, inertia,
                             extra, emerged_m3, hub)
        rows = dict(zip(names, log.reshape(-1, SAMPLE_STEPS, len(names)).mean(axis=1).T))
        result = Result(
            time_s=(np.arange(steps // SAMPLE_STEPS) * SAMPLE_STEPS + 0.5 * (SAMPLE_STEPS - 1)) * dt,
            tension_n=rows["tension_n"], hoist_position_m=rows["hoist_position_m"],
            hoist_speed_mps=rows["hoist_speed_mps"], hoist_command_mps=rows["hoist_command_mps"],
            lateral_n=np.column_stack((rows["lateral_x_n"], rows["lateral_y_n"])),
            components={name: rows[name] for name in names[6:]})
        for effect in self.effects:
            effect.after(self, result)
        return result


def hoist_command(segments, acceleration_mps2=0.2):
    """Speeds (m/s) per TIME_STEP_S for segments (duration_s, speed_mps), with limited acceleration between them."""
    wanted = np.concatenate([np.full(round(duration / TIME_STEP_S), speed) for duration, speed in segments])
    command, now = np.empty_like(wanted), 0.0
    for step, speed in enumerate(wanted):
        now += float(np.clip(speed - now, -acceleration_mps2 * TIME_STEP_S, acceleration_mps2 * TIME_STEP_S))
        command[step] = now
    return command
