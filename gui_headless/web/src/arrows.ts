// Forces and impulses as arrows, the device beside its proxy as a ghost with a line.
import * as THREE from "three";
import type { Bodies } from "./bodies";
import { length, SHAPES, type Model, type Turn, type Vector } from "./model";
import { userColour } from "./theme";

const MOST = 1024;
const IN_VIEW = 0.9; // of the distance from the middle of the picture to its edge
const UP = new THREE.Vector3(0, 1, 0);

/** The largest of 1, 2, 5 times a power of ten that is not above `value`. */
export function niceBelow(value: number): number {
  const power = 10 ** Math.floor(Math.log10(value));
  return [5, 2, 1].map((one) => one * power).find((one) => one <= value * (1 + 1e-9)) ?? power;
}

/** Length per unit, so that the largest value of late is about `wanted_m` long. It changes rarely. */
class Scale {
  perUnit = 0;
  private largest = 0;

  take(values: number[], wanted_m: number): void {
    this.largest = Math.max(0.998 * this.largest, ...values);
    if (!(this.largest > 0)) return;
    const ideal = wanted_m / this.largest;
    if (this.perUnit < 0.3 * ideal || this.perUnit > 1.3 * ideal) this.perUnit = ideal;
  }

  reset(): void {
    this.perUnit = this.largest = 0;
  }
}

const quaternion = (q: Turn) => new THREE.Quaternion(q.x, q.y, q.z, q.w);

/** Arrows of one kind, in front of all bodies: most begin inside one. */
class ArrowSet {
  readonly root = new THREE.Group();
  private readonly shaft: THREE.InstancedMesh;
  private readonly head: THREE.InstancedMesh;
  private count = 0;
  private readonly matrix = new THREE.Matrix4();
  private readonly turn = new THREE.Quaternion();
  private readonly along = new THREE.Vector3();
  private readonly at = new THREE.Vector3();

  constructor(private readonly most: number, opacity: number, order: number) {
    const material = new THREE.MeshBasicMaterial({ depthTest: false, transparent: true, opacity, toneMapped: false });
    this.shaft = new THREE.InstancedMesh(new THREE.CylinderGeometry(1, 1, 1, 12).translate(0, 0.5, 0), material, most);
    this.head = new THREE.InstancedMesh(new THREE.ConeGeometry(1, 1, 16).translate(0, 0.5, 0), material, most);
    for (const mesh of [this.shaft, this.head]) {
      mesh.frustumCulled = false;
      mesh.renderOrder = order;
      mesh.setColorAt(0, new THREE.Color());
      this.root.add(mesh);
    }
  }

  begin(): void {
    this.count = 0;
  }

  add(from: THREE.Vector3, vector: Vector, scale: number, thick: number, colour: THREE.Color): void {
    const size = length(vector) * scale;
    if (this.count >= this.most || !(size > 2 * thick)) return;
    this.along.set(vector.x, vector.y, vector.z).normalize();
    this.turn.setFromUnitVectors(UP, this.along);
    const headSize = Math.min(4.5 * thick, 0.5 * size), i = this.count++;
    this.matrix.compose(from, this.turn, new THREE.Vector3(thick, size - headSize, thick));
    this.shaft.setMatrixAt(i, this.matrix);
    this.at.copy(this.along).multiplyScalar(size - headSize).add(from);
    this.matrix.compose(this.at, this.turn, new THREE.Vector3(2.3 * thick, headSize, 2.3 * thick));
    this.head.setMatrixAt(i, this.matrix);
    for (const mesh of [this.shaft, this.head]) mesh.setColorAt(i, colour);
  }

  end(): void {
    for (const mesh of [this.shaft, this.head]) {
      mesh.count = this.count;
      mesh.visible = this.count > 0;
      for (const attribute of this.count > 0 ? [mesh.instanceMatrix, mesh.instanceColor!] : []) {
        attribute.clearUpdateRanges();
        attribute.addUpdateRange(0, this.count * attribute.itemSize);
        attribute.needsUpdate = true;
      }
    }
  }
}

/** How much of the way from a point stays in the picture, with a margin; 1 where the point itself is outside. */
function shareInView(from: THREE.Vector3, way: THREE.Vector3, camera: THREE.Camera): number {
  const toPicture = new THREE.Matrix4().multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
  const begin = new THREE.Vector4(from.x, from.y, from.z, 1).applyMatrix4(toPicture);
  const along = new THREE.Vector4(way.x, way.y, way.z, 0).applyMatrix4(toPicture);
  let share = 1;
  for (const [axis, side] of [["x", 1], ["x", -1], ["y", 1], ["y", -1]] as const) {
    const room = IN_VIEW * begin.w - side * begin[axis], closing = side * along[axis] - IN_VIEW * along.w;
    if (room < 0) return 1;
    if (closing > 0) share = Math.min(share, room / closing);
  }
  return share;
}

/** A text at a place of the picture, both axes from -1 to 1. */
function valueAt(place: THREE.Vector3, text: string): HTMLElement {
  const value = document.createElement("span");
  value.className = "floating value-of-arrow";
  value.style.left = `clamp(32px, ${50 * (1 + place.x)}%, 100% - 32px)`;
  value.style.top = `${50 * (1 - place.y)}%`;
  value.textContent = text;
  return value;
}

export class Arrows {
  readonly root = new THREE.Group();
  /** Above the picture: values of arrows that are longer than the view. */
  readonly values = document.createElement("div");
  readonly forceScale = new Scale();
  readonly impulseScale = new Scale();
  showForces = true;
  showImpulses = true;
  showDevices = true;
  private readonly forces = new ArrowSet(64, 1, 5);
  private readonly impulses = new ArrowSet(MOST, 0.9, 4);
  private ghosts: { ghost: THREE.Mesh; line: THREE.Line }[] = [];

  constructor() {
    this.root.add(this.forces.root, this.impulses.root);
  }

  reset(): void {
    this.forceScale.reset();
    this.impulseScale.reset();
    for (const { ghost, line } of this.ghosts) this.root.remove(ghost, line);
    this.ghosts = [];
  }

  place(model: Model, bodies: Bodies, bodyRadius: number, camera: THREE.Camera): void {
    this.placeForces(model, bodies, bodyRadius, camera);
    this.placeImpulses(model, bodies, bodyRadius);
    model.users.forEach((user, i) => this.placeDevice(model, bodies, i, user.user, user.proxy));
  }

  /** The force on each operator, at the proxy. An arrow that would leave the view ends at its edge, with its value. */
  private placeForces(model: Model, bodies: Bodies, radius: number, camera: THREE.Camera): void {
    this.forces.begin();
    this.forceScale.take([...model.forces.values()].map(length), 3.2 * radius);
    const at = new THREE.Vector3(), values: HTMLElement[] = [];
    for (const user of this.showForces ? model.users : []) {
      const force = model.forces.get(user.user);
      if (!force) continue;
      const scale = this.forceScale.perUnit, way = new THREE.Vector3(force.x, force.y, force.z).multiplyScalar(scale);
      const share = shareInView(bodies.position(user.proxy, at), way, camera);
      this.forces.add(at, force, share * scale, 0.11 * radius, new THREE.Color(userColour(user.user)));
      if (share < 1) values.push(valueAt(at.addScaledVector(way, share).project(camera), `${length(force).toFixed(1)} N`));
    }
    this.values.replaceChildren(...values);
    this.forces.end();
  }

  /** For each member at the border the sum of what the outside gives it in a cycle. */
  private placeImpulses(model: Model, bodies: Bodies, radius: number): void {
    this.impulses.begin();
    const at = new THREE.Vector3();
    for (const user of this.showImpulses ? model.users : []) {
      const members = new Set(user.members), sums = new Map<number, Vector>();
      for (const { inside, normal: n, normal_impulse: p, tangential_impulse: t } of user.border) {
        if (!members.has(inside)) continue;
        const sum = sums.get(inside) ?? { x: 0, y: 0, z: 0 };
        sums.set(inside, { x: sum.x + n.x * p + t.x, y: sum.y + n.y * p + t.y, z: sum.z + n.z * p + t.z });
      }
      this.impulseScale.take([...sums.values()].map(length), 2.2 * radius);
      const colour = new THREE.Color(userColour(user.user)).offsetHSL(0, 0.1, -0.14);
      for (const [id, sum] of sums)
        this.impulses.add(bodies.position(id, at), sum, this.impulseScale.perUnit, 0.07 * radius, colour);
    }
    this.impulses.end();
  }

  private placeDevice(model: Model, bodies: Bodies, i: number, user: number, proxy: number): void {
    const known = model.devices.get(user), body = model.bodies[proxy];
    this.ghosts[i] ??= this.makeGhost(user, body?.half_extents, SHAPES[body?.shape ?? 0], body?.radius ?? 0);
    const { ghost, line } = this.ghosts[i];
    ghost.visible = line.visible = this.showDevices && known?.device !== undefined && known.proxy !== undefined;
    if (!known?.device || !known.proxy) return;
    // The axes of both frames are parallel: the gap is the same in both.
    const at = bodies.position(proxy, new THREE.Vector3()), { device, proxy: own } = known;
    ghost.position.copy(device.position).sub(own.position as THREE.Vector3).add(at);
    bodies.orientation(proxy, ghost.quaternion).premultiply(quaternion(own.orientation).conjugate())
      .premultiply(quaternion(device.orientation));
    const ends = line.geometry.getAttribute("position") as THREE.BufferAttribute;
    ends.setXYZ(0, at.x, at.y, at.z);
    ends.setXYZ(1, ghost.position.x, ghost.position.y, ghost.position.z);
    ends.needsUpdate = true;
  }

  private makeGhost(user: number, half: Vector, shape: string, radius: number): { ghost: THREE.Mesh; line: THREE.Line } {
    const colour = userColour(user);
    const geometry = shape === "box" ? new THREE.BoxGeometry(2 * half.x, 2 * half.y, 2 * half.z)
      : new THREE.SphereGeometry(radius || 0.03, 28, 20);
    const ghost = new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({
      color: colour, transparent: true, opacity: 0.32, depthWrite: false,
      polygonOffset: true, polygonOffsetFactor: -2, polygonOffsetUnits: -2, // in front of a proxy that has the same place
    }));
    ghost.renderOrder = 2;
    const ends = new THREE.BufferGeometry();
    ends.setAttribute("position", new THREE.Float32BufferAttribute([0, 0, 0, 0, 0, 0], 3));
    const line = new THREE.Line(ends, new THREE.LineBasicMaterial({ color: colour, depthTest: false, transparent: true }));
    line.frustumCulled = false;
    line.renderOrder = 6;
    this.root.add(ghost, line);
    return { ghost, line };
  }
}
