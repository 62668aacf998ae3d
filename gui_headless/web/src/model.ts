// The run as last received.
import type { Table, Value } from "./cdr";

export type Vector = { x: number; y: number; z: number };
export type Turn = Vector & { w: number };
export type Pose = { position: Vector; orientation: Turn };
export type Body = {
  id: number; name: string; shape: number; half_extents: Vector; radius: number; half_length: number; mesh: number;
  friction: number; restitution: number; mass: number;
};
export type Mesh = { vertices: Vector[]; triangles: { a: number; b: number; c: number }[] };
export type BorderContact = {
  inside: number; outside: number; point: Vector; normal: Vector; distance: number; normal_impulse: number;
  tangential_impulse: Vector;
};
export type UserView = {
  user: number; proxy: number; members: number[]; border: BorderContact[]; wrench: { force: Vector; torque: Vector };
};
export type Program = { status: Value; at: number; missed: number; missedPerSecond: number };

export const SHAPES = ["sphere", "box", "capsule", "cylinder", "plane", "convex", "mesh"];
export const PROGRAMS = ["world_sim", "haptic_sim", "device_sim", "gui_headless"];
export const length = (v: Vector) => Math.hypot(v.x, v.y, v.z);

/** Poses (position, then orientation x, y, z, w) and velocities of all bodies. */
export class States {
  readonly from: Float64Array;
  readonly to: Float64Array;
  readonly speed: Float64Array;
  changed_ms = 0;
  interval_ms = 33;

  constructor(readonly count: number) {
    this.from = new Float64Array(7 * count);
    this.to = new Float64Array(7 * count);
    this.speed = new Float64Array(count);
  }

  /** Motion is drawn from what is shown now to `placed`, for as long as the last interval took. */
  take(placed: Table, now_ms: number): void {
    this.pose(this.from, now_ms);
    const gap = now_ms - this.changed_ms;
    this.interval_ms = Math.min(250, Math.max(16, 0.7 * this.interval_ms + 0.3 * gap));
    this.changed_ms = now_ms;
    const { count, stride, numbers, words } = placed;
    for (let i = 0; i < count; ++i) {
      const id = words[i], at = i * stride;
      if (id >= this.count) continue;
      this.put(id, numbers, at, at + 3);
      this.to[7 * id + 6] = Math.sqrt(Math.max(0, 1 - numbers[at + 3] ** 2 - numbers[at + 4] ** 2 - numbers[at + 5] ** 2));
      this.speed[id] = numbers[at + 6];
    }
  }

  /** States as the scene has them: position, orientation w, x, y, z, velocities. */
  reset({ count, stride, numbers, words }: Table): void {
    for (let i = 0; i < count; ++i) {
      const id = words[i], at = i * stride;
      if (id >= this.count) continue;
      this.put(id, numbers, at, at + 4);
      this.to[7 * id + 6] = numbers[at + 3];
      this.speed[id] = Math.hypot(numbers[at + 7], numbers[at + 8], numbers[at + 9]);
    }
    this.from.set(this.to);
  }

  private put(id: number, numbers: Table["numbers"], position: number, turn: number): void {
    for (let k = 0; k < 3; ++k) {
      this.to[7 * id + k] = numbers[position + k];
      this.to[7 * id + 3 + k] = numbers[turn + k];
    }
  }

  /** Whether the picture still moves. */
  moving(now_ms: number): boolean {
    return now_ms - this.changed_ms < this.interval_ms + 50;
  }

  /** Writes the poses of this moment. */
  pose(into: Float64Array, now_ms: number): void {
    const share = Math.min(1, (now_ms - this.changed_ms) / this.interval_ms);
    const { from, to } = this;
    if (share >= 1) return void into.set(to);
    for (let at = 0; at < to.length; at += 7) {
      for (let k = 0; k < 3; ++k) into[at + k] = from[at + k] + share * (to[at + k] - from[at + k]);
      let dot = 0, square = 0;
      for (let k = 3; k < 7; ++k) dot += from[at + k] * to[at + k];
      const sign = dot < 0 ? -1 : 1;
      for (let k = 3; k < 7; ++k) {
        const value = (1 - share) * sign * from[at + k] + share * to[at + k];
        into[at + k] = value;
        square += value * value;
      }
      const scale = 1 / Math.sqrt(square || 1);
      for (let k = 3; k < 7; ++k) into[at + k] *= scale;
    }
  }
}

export class Model {
  name = "";
  userCount = 0;
  settings = new Map<string, string>();
  bodies: Body[] = [];
  meshes: Mesh[] = [];
  states = new States(0);
  users: UserView[] = [];
  devices = new Map<number, { device?: Pose; proxy?: Pose }>(); // both in the frame of the device
  programs = new Map<string, Program>();
  time_s = 0;
  realTimeFactor = 1;
  paused = false;
  snapshots = 0;

  describe(scene: Value): void {
    this.name = scene.name;
    this.userCount = scene.users;
    this.settings = new Map(scene.settings.map((one: Value) => [one.name, one.value]));
    this.bodies = scene.bodies;
    this.meshes = scene.meshes;
    this.states = new States(this.bodies.length);
    this.states.reset(scene.states);
  }

  show(snapshot: Value, now_ms: number): void {
    this.time_s = snapshot.stamp_s;
    this.realTimeFactor = snapshot.real_time_factor;
    this.users = snapshot.users;
    this.states.take(snapshot.placed, now_ms);
    ++this.snapshots;
  }

  moveDevice(user: number, what: "device" | "proxy", pose: Pose): void {
    this.devices.set(user, { ...this.devices.get(user), [what]: pose });
  }

  hear(status: Value, now_ms: number): void {
    const key = `${status.program}/${status.instance}`;
    const missed = Number(status.missed_deadlines);
    const before = this.programs.get(key);
    const span_s = before ? (now_ms - before.at) / 1000 : 0;
    const rate = before && span_s > 0.3 ? Math.max(0, missed - before.missed) / span_s : (before?.missedPerSecond ?? 0);
    this.programs.set(key, { status, at: now_ms, missed, missedPerSecond: rate });
    if (PROGRAMS[status.program] === "world_sim") this.paused = status.paused;
  }

  /** The page stood still for so long, and what arrived meanwhile waits. */
  excuse(time_ms: number): void {
    for (const program of this.programs.values()) program.at += time_ms;
  }

  isFixed(body: Body): boolean {
    return !(body.mass > 0);
  }
}
