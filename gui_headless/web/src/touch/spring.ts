// The coupling of the held tool as a spring between device and proxy. Its colour shows the size of the force.
import * as THREE from "three";

const TURNS = 9, POINTS_A_TURN = 20, COUNT = TURNS * POINTS_A_TURN + 1;
const ENDS = 0.12; // part of the length that is straight, at each end

/** Green without force, yellow at half the scale, red at all of it. */
export function forceColour(part: number, into = new THREE.Color()): THREE.Color {
  return into.setHSL((1 - Math.min(1, Math.max(0, part))) / 3, 0.85, 0.48);
}

export class Spring {
  readonly root: THREE.Line;
  private readonly points = new Float32Array(3 * COUNT);
  private readonly material = new THREE.LineBasicMaterial({ depthTest: false, transparent: true, toneMapped: false });

  constructor() {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(this.points, 3));
    this.root = new THREE.Line(geometry, this.material);
    this.root.frustumCulled = false;
    this.root.renderOrder = 7;
    this.root.visible = false;
  }

  hide(): void {
    this.root.visible = false;
  }

  /** `part`: the force, as part of the scale. */
  show(from: THREE.Vector3, to: THREE.Vector3, radius: number, part: number): void {
    const axis = to.clone().sub(from), size = axis.length();
    this.root.visible = size > 0.02 * radius;
    if (!this.root.visible) return;
    axis.divideScalar(size);
    const side = new THREE.Vector3(0, 0, 1).cross(axis);
    if (side.lengthSq() < 1e-4) side.set(1, 0, 0).cross(axis);
    side.normalize();
    const other = axis.clone().cross(side), coil = Math.min(radius, 0.5 * size);
    for (let i = 0; i < COUNT; ++i) {
      const share = i / (COUNT - 1), along = share * size;
      const inside = Math.min(1, Math.min(share, 1 - share) / ENDS), angle = 2 * Math.PI * TURNS * share;
      const c = coil * inside * Math.cos(angle), s = coil * inside * Math.sin(angle);
      this.points[3 * i] = from.x + along * axis.x + c * side.x + s * other.x;
      this.points[3 * i + 1] = from.y + along * axis.y + c * side.y + s * other.y;
      this.points[3 * i + 2] = from.z + along * axis.z + c * side.z + s * other.z;
    }
    this.root.geometry.getAttribute("position").needsUpdate = true;
    forceColour(part, this.material.color);
  }
}
