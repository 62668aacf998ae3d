// Boxes for a processor that draws in the place of a graphics card: of each the three faces that can be seen, as finished
// triangles with finished colours. For thousands of boxes that costs a third of what shaders need for all faces.
import * as THREE from "three";

/** Light from the sun and from all around, linear. */
export type Light = { toSun: THREE.Vector3; sun: THREE.Color; above: THREE.Color; below: THREE.Color };

const LEVELS = 2048;
/** A linear value, in steps of 1 / LEVELS, as the screen shows it. */
const SHOWN = Uint8Array.from({ length: LEVELS + 1 }, (_, i) =>
  Math.round(255 * new THREE.Color().setRGB(i / LEVELS, 0, 0).convertLinearToSRGB().r));
const shown = (value: number) => SHOWN[Math.min(LEVELS, value * LEVELS) | 0];

const VERTEX = `
attribute vec4 colour;
varying vec3 vLit;
varying vec2 vFace;
void main() {
  vLit = colour.rgb;
  vFace = vec2(gl_VertexID & 1, (gl_VertexID >> 1) & 1);
  gl_Position = projectionMatrix * viewMatrix * vec4(position, 1.0);
}`;

export class VisibleFaces {
  readonly mesh: THREE.Mesh;
  private readonly positions: THREE.BufferAttribute;
  private readonly colours: THREE.BufferAttribute;
  private readonly stale: Uint8Array;
  private readonly eye = new THREE.Vector3();
  private light?: Light;

  /** For so many boxes. `fragmentShader` has the varyings vLit and vFace. */
  constructor(count: number, fragmentShader: string, defines: Record<string, string>) {
    this.stale = new Uint8Array(count).fill(1);
    this.positions = new THREE.BufferAttribute(new Float32Array(36 * count), 3).setUsage(THREE.DynamicDrawUsage);
    this.colours = new THREE.BufferAttribute(new Uint8Array(48 * count), 4, true).setUsage(THREE.DynamicDrawUsage);
    const corners = new Uint32Array(18 * count);
    for (let face = 0; face < 3 * count; ++face) corners.set([0, 1, 2, 2, 1, 3].map((one) => 4 * face + one), 6 * face);
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", this.positions);
    geometry.setAttribute("colour", this.colours);
    geometry.setIndex(new THREE.BufferAttribute(corners, 1));
    this.mesh = new THREE.Mesh(geometry, new THREE.ShaderMaterial({
      vertexShader: VERTEX, fragmentShader, defines, uniforms: { opacity: { value: 1 } }, side: THREE.DoubleSide,
    }));
    this.mesh.frustumCulled = false;
  }

  /** A box has moved, or its colour has changed. */
  touch(slot: number): void {
    this.stale[slot] = 1;
  }

  /** `matrices`: of each box from the unit cube of half-width 1, 16 numbers. `tints`: linear, 3 numbers. */
  update(matrices: ArrayLike<number>, tints: ArrayLike<number>, eye: THREE.Vector3, light: Light): void {
    if (light !== this.light || !this.eye.equals(eye)) this.stale.fill(1);
    this.light = light;
    this.eye.copy(eye);
    let any = false;
    for (let slot = 0; slot < this.stale.length; ++slot) {
      if (!this.stale[slot]) continue;
      any = true;
      for (let axis = 0; axis < 3; ++axis) this.face(slot, axis, matrices, tints, light);
    }
    this.stale.fill(0);
    if (any) this.positions.needsUpdate = this.colours.needsUpdate = true;
  }

  dispose(): void {
    this.mesh.geometry.dispose();
    (this.mesh.material as THREE.Material).dispose();
  }

  /** The face along an axis of the box, on the side of the eye. */
  private face(slot: number, axis: number, m: ArrayLike<number>, tints: ArrayLike<number>, light: Light): void {
    const o = 16 * slot, k = o + 4 * axis, i = o + 4 * ((axis + 1) % 3), j = o + 4 * ((axis + 2) % 3);
    const cx = m[o + 12], cy = m[o + 13], cz = m[o + 14], { eye } = this;
    let x = m[k], y = m[k + 1], z = m[k + 2];
    if (x * (eye.x - cx) + y * (eye.y - cy) + z * (eye.z - cz) < 0) (x = -x), (y = -y), (z = -z);
    const position = this.positions.array as Float32Array;
    let at = 12 * (3 * slot + axis);
    for (let v = -1; v <= 1; v += 2)
      for (let u = -1; u <= 1; u += 2) {
        position[at++] = cx + x + u * m[i] + v * m[j];
        position[at++] = cy + y + u * m[i + 1] + v * m[j + 1];
        position[at++] = cz + z + u * m[i + 2] + v * m[j + 2];
      }
    const size = Math.sqrt(x * x + y * y + z * z) || 1, { toSun, sun, above, below } = light;
    const up = 0.5 + (0.5 * z) / size, toward = Math.max(0, (x * toSun.x + y * toSun.y + z * toSun.z) / size);
    const red = shown((tints[3 * slot] / Math.PI) * (toward * sun.r + up * above.r + (1 - up) * below.r));
    const green = shown((tints[3 * slot + 1] / Math.PI) * (toward * sun.g + up * above.g + (1 - up) * below.g));
    const blue = shown((tints[3 * slot + 2] / Math.PI) * (toward * sun.b + up * above.b + (1 - up) * below.b));
    const colour = this.colours.array as Uint8Array;
    for (let corner = 16 * (3 * slot + axis), end = corner + 16; corner < end; corner += 4) {
      colour[corner] = red;
      colour[corner + 1] = green;
      colour[corner + 2] = blue;
    }
  }
}
