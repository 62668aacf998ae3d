// This page as the device of a user: who holds which tool, and the motion of the one that is held here by mouse, touch
// and keys. A pose is sent with each frame, at most 120 a second. It counts from where the tool was taken.
import * as THREE from "three";
import { encodeToolPose, type Value } from "../cdr";
import type { Connection } from "../connection";
import type { Model, Vector } from "../model";
import type { View } from "../view";

export type Tool = { user: number; holder: number };

const SHORTEST_MS = 1000 / 120 - 0.5, LATE_MS = 50;
const REACH_M = 1.99; // of the server
const ANSWER_MS = 1500; // then a tool that another page holds is given up

export class Touch {
  tools: Tool[] = [];
  /** Whose tool this page holds, or is taking; -1: none. */
  user = -1;
  /** Of the tool from where it was taken, m, and its turn since then. */
  readonly offset = new THREE.Vector3();
  readonly orientation = new THREE.Quaternion();
  buttons = 0;
  sent = 0;
  changed?: () => void;
  /** Once a frame while a tool is held, with the seconds since the last one. */
  moved?: (passed_s: number) => void;
  private readonly keys = new Set<string>();
  private readonly plane = new THREE.Plane();
  private readonly hit = new THREE.Vector3();
  private drag?: { pointer: number; last: THREE.Vector3; x: number; y: number };
  private sentAt = 0;
  private frameAt = 0;
  private takenAt = 0;

  constructor(private readonly connection: Connection, private readonly view: View, private readonly model: Model,
    private readonly canvas: HTMLCanvasElement) {
    // Before the camera's controls see the event.
    canvas.addEventListener("pointerdown", (event) => this.press(event), { capture: true });
    canvas.addEventListener("pointermove", (event) => this.dragTo(event));
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"] as const)
      canvas.addEventListener(end, (event) => this.endDrag(event));
    canvas.addEventListener("wheel", (event) => this.wheel(event), { capture: true, passive: false });
    document.addEventListener("keyup", (event) => this.keys.delete(event.key));
    window.addEventListener("blur", () => this.keys.clear());
    window.addEventListener("pagehide", () => this.release());
    document.addEventListener("visibilitychange", () => document.hidden && this.release());
    const frame = (now: number) => {
      requestAnimationFrame(frame);
      this.frame(now);
    };
    requestAnimationFrame(frame);
    setInterval(() => performance.now() - this.sentAt > LATE_MS && this.frame(performance.now()), LATE_MS);
  }

  /** Whether the server has confirmed it. */
  get holds(): boolean {
    return this.user >= 0 && this.tools.some((one) => one.user === this.user && one.holder === this.connection.number);
  }
  get force(): Vector {
    return this.model.forces.get(this.user) ?? { x: 0, y: 0, z: 0 };
  }

  take(user: number): void {
    if (this.user === user) return;
    this.release();
    this.user = user;
    this.offset.set(0, 0, 0);
    this.orientation.identity();
    this.takenAt = performance.now();
    this.view.turnWithLeft(false);
    this.focus();
    this.changed?.();
  }

  /** Keys are for the tool from now on. */
  focus(): void {
    this.canvas.focus();
  }

  release(): void {
    if (this.user < 0) return;
    this.connection.moveTool(this.user, encodeToolPose([0, 0, 0], [1, 0, 0, 0], 0, false));
    this.forget();
  }

  /** Takes what belongs to it. */
  receive(topic: string, value: Value): void {
    if (topic !== "/tools") return;
    this.tools = value.tools;
    const mine = this.tools.find((one) => one.user === this.user);
    if (this.user >= 0 && (!mine || (mine.holder !== 0 && mine.holder !== this.connection.number))) this.forget();
    this.changed?.();
  }

  /** The connection is not that of before. */
  lost(): void {
    this.tools = [];
    this.forget();
    this.changed?.();
  }

  /** What the tools need; more than that where one is held. */
  topics(): string[] {
    return this.user < 0 ? ["/tools"] : ["/tools", `/user_${this.user}/device_command`, `/user_${this.user}/device_state`];
  }

  /** True: the key was for the tool. */
  key(event: KeyboardEvent): boolean {
    if (this.user < 0) return false;
    if (event.key === "Escape") {
      this.release();
      return true;
    }
    const target = event.target as HTMLElement;
    if (target !== this.canvas && target !== document.body) return false;
    if (event.ctrlKey || event.metaKey || event.altKey || !(event.key in DIRECTIONS)) return false;
    this.keys.add(event.key);
    return true;
  }

  /** Where the device of the held tool is in the scene; null: not known yet. */
  place(into: THREE.Vector3): THREE.Vector3 | null {
    const known = this.model.devices.get(this.user), proxy = this.proxy();
    if (proxy === undefined) return null;
    this.view.bodies.position(proxy, into);
    if (!known?.device || !known.proxy) return into;
    const { device, proxy: own } = known;
    return into.add(new THREE.Vector3(device.position.x - own.position.x, device.position.y - own.position.y,
      device.position.z - own.position.z));
  }

  proxy(): number | undefined {
    return this.model.users.find((one) => one.user === this.user)?.proxy;
  }

  /** Along the axes of the picture: right, up, away; m. */
  shift(right_m: number, up_m: number, away_m: number): void {
    const { x, y, z } = this.view.axes();
    this.offset.addScaledVector(x, right_m).addScaledVector(y, up_m).addScaledVector(z, -away_m);
    this.offset.clampScalar(-REACH_M, REACH_M);
  }

  /** About the axes of the picture, right-handed: right, up, away; rad. */
  turn(right_rad: number, up_rad: number, away_rad: number): void {
    const { x, y, z } = this.view.axes();
    const axis = x.multiplyScalar(right_rad).addScaledVector(y, up_rad).addScaledVector(z, -away_rad), angle = axis.length();
    if (angle > 0) this.orientation.premultiply(new THREE.Quaternion().setFromAxisAngle(axis.divideScalar(angle), angle)).normalize();
  }

  private forget(): void {
    if (this.user < 0) return;
    this.user = -1;
    this.drag = undefined;
    this.keys.clear();
    this.view.turnWithLeft(true);
    this.changed?.();
  }

  private frame(now: number): void {
    const passed_s = Math.min(0.1, (now - this.frameAt) / 1000);
    this.frameAt = now;
    if (this.user < 0 || document.hidden) return;
    if (!this.holds && now - this.takenAt > ANSWER_MS && this.tools.some((one) => one.user === this.user && one.holder)) return this.forget();
    const step = 2 * this.view.size_m() * passed_s;
    for (const key of this.keys) {
      const [right, up, away] = DIRECTIONS[key];
      this.shift(right * step, up * step, away * step);
    }
    this.moved?.(passed_s);
    if (now - this.sentAt < SHORTEST_MS) return;
    this.sentAt = now;
    const { x, y, z, w } = this.orientation;
    if (this.connection.moveTool(this.user, encodeToolPose(this.offset.toArray(), [w, x, y, z], this.buttons, true))) ++this.sent;
  }

  private press(event: PointerEvent): void {
    if (!event.isPrimary) this.drag = undefined; // two fingers turn the camera
    if (event.button !== 0 || !event.isPrimary) return;
    if (this.user < 0) {
      // The proxy of a free tool can be grabbed.
      const id = this.view.bodies.pick(this.view.caster(event));
      const user = this.model.users.find((one) => one.proxy === id)?.user;
      if (user === undefined || !this.tools.some((one) => one.user === user && one.holder === 0)) return;
      this.take(user);
    }
    const at = this.place(new THREE.Vector3());
    if (!at) return;
    this.plane.setFromNormalAndCoplanarPoint(this.view.axes().z, at);
    const last = this.ray(event);
    if (!last) return;
    this.canvas.setPointerCapture(event.pointerId);
    this.drag = { pointer: event.pointerId, last: last.clone(), x: event.clientX, y: event.clientY };
  }

  /** In the plane of the picture; with Shift, up and down are away and near. */
  private dragTo(event: PointerEvent): void {
    const { drag } = this;
    if (!drag || event.pointerId !== drag.pointer) return;
    const to = this.ray(event);
    if (!to) return;
    const way = to.clone().sub(drag.last), { x, y } = this.view.axes();
    this.shift(way.dot(x), event.shiftKey ? 0 : way.dot(y), event.shiftKey ? way.dot(y) : 0);
    drag.last.copy(to);
  }

  private endDrag(event: PointerEvent): void {
    if (event.pointerId === this.drag?.pointer) this.drag = undefined;
  }

  private wheel(event: WheelEvent): void {
    if (!this.drag) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    this.shift(0, 0, (-Math.sign(event.deltaY) * this.view.size_m()) / 8);
  }

  private ray(event: PointerEvent): THREE.Vector3 | null {
    return this.view.caster(event).ray.intersectPlane(this.plane, this.hit);
  }
}

/** Right, up, away. */
const DIRECTIONS: Record<string, [number, number, number]> = {
  ArrowLeft: [-1, 0, 0], ArrowRight: [1, 0, 0], ArrowUp: [0, 1, 0], ArrowDown: [0, -1, 0], PageUp: [0, 0, 1], PageDown: [0, 0, -1],
};

