// The run as last received.
import type { Value } from "./cdr";
import { States } from "./states";

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
/** A solid for a joint or a part of it: on the body `at`, turned with the body `along`. */
export type JointMark = {
  joint: number; form: number; at: number; along: number; point: Vector; turn: Turn; shift: number; radius: number; half_length: number;
};
export type Program = {
  status: Value; at: number; missed: number; missedPerSecond: number; absences: number; absent_ms: number;
};
export type Gate = {
  name: string; value: number; bound: number; at_most: boolean; unit: string; ok: boolean; warning: boolean;
  missed_by: string; why: string;
};
export type Verdict = { verdict: string; gates: Gate[] };
export type Place = { dds: string; host: string; process: string };

export const ABSENT_MS = 3500; // each program publishes its status once a second

export const SHAPES = ["sphere", "box", "capsule", "cylinder", "plane", "convex", "mesh"];
export const PROGRAMS = ["world_sim", "haptic_sim", "device_sim", "gui_headless"];
export const length = (v: Vector) => Math.hypot(v.x, v.y, v.z);

export class Model {
  name = "";
  userCount = 0;
  settings = new Map<string, string>();
  bodies: Body[] = [];
  meshes: Mesh[] = [];
  states = new States(0);
  users: UserView[] = [];
  brokenJoints: number[] = [];
  devices = new Map<number, { device?: Pose; proxy?: Pose }>(); // both in the frame of the device
  forces = new Map<number, Vector>(); // on the operators, as far as they are received
  programs = new Map<string, Program>();
  places = new Map<string, Place>(); // of programs, by the same keys
  time_s = 0;
  realTimeFactor = 1;
  paused = false;
  snapshots = 0;
  verdict?: Verdict; // known at the end of a run

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
    this.brokenJoints = snapshot.broken_joints;
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
    const gap = before && now_ms - before.at > ABSENT_MS ? now_ms - before.at : 0;
    this.programs.set(key, {
      status, at: now_ms, missed, missedPerSecond: rate,
      absences: (before?.absences ?? 0) + (gap ? 1 : 0), absent_ms: (before?.absent_ms ?? 0) + gap,
    });
    if (PROGRAMS[status.program] === "world_sim") this.paused = status.paused;
  }

  placeProgram(place: Value): void {
    this.places.set(`${place.program}/${place.instance}`, place);
  }

  /** The page stood still for so long, and what arrived meanwhile waits. */
  excuse(time_ms: number): void {
    for (const program of this.programs.values()) program.at += time_ms;
  }

  isFixed(body: Body): boolean {
    return !(body.mass > 0);
  }
}
