// Many bodies as one large mesh. A processor that draws in the place of a graphics card needs as long to begin an instance
// as to draw a cube; here there is one draw call for all of them. Matrices and colours are in textures.
import * as THREE from "three";

const ROW = 256; // bodies in a row of a texture
const MOST_VERTICES = 1_000_000;

const texture = (data: Float32Array, width: number) =>
  new THREE.DataTexture(data, width, data.length / (4 * width), THREE.RGBAFormat, THREE.FloatType);

export class Merged {
  readonly mesh: THREE.Mesh;
  private readonly places: THREE.DataTexture;
  private readonly colours: THREE.DataTexture;

  /** Whether that many copies are worth it, and fit. */
  static suits(geometry: THREE.BufferGeometry, count: number): boolean {
    return count > 1 && geometry.getAttribute("position").count * count <= MOST_VERTICES;
  }

  /** How many matrices an array must have room for. */
  static roomFor(count: number): number {
    return ROW * Math.ceil(count / ROW);
  }

  /** Draws what `source` would. It has room for whole rows, and its material becomes `placed`. */
  constructor(source: THREE.InstancedMesh) {
    const room = source.instanceMatrix.count;
    this.places = texture(source.instanceMatrix.array as Float32Array, 4 * ROW);
    this.colours = texture(new Float32Array(4 * room), ROW);
    const material = this.placed(source.material as THREE.Material);
    this.mesh = new THREE.Mesh(copies(source.geometry, source.count), material);
    this.mesh.customDepthMaterial = this.placed(new THREE.MeshDepthMaterial());
    this.mesh.castShadow = source.castShadow;
    this.mesh.receiveShadow = source.receiveShadow;
    this.mesh.frustumCulled = false;
    source.visible = false; // it is still what a click picks
  }

  colour(slot: number, colour: THREE.Color): void {
    colour.toArray(this.colours.image.data as Float32Array, 4 * slot);
    this.colours.needsUpdate = true;
  }

  move(): void {
    this.places.needsUpdate = true;
  }

  dispose(): void {
    this.mesh.geometry.dispose();
    this.mesh.customDepthMaterial!.dispose();
    this.places.dispose();
    this.colours.dispose();
  }

  /** A material of this mesh. */
  placed<M extends THREE.Material>(material: M): M {
    const before = material.onBeforeCompile, key = `merged ${before}`;
    material.onBeforeCompile = (shader, renderer) => {
      before.call(material, shader, renderer);
      Object.assign(shader.uniforms, { places: { value: this.places }, tints: { value: this.colours } });
      shader.vertexShader = shader.vertexShader
        .replace("#include <common>", `#include <common>
          #define USE_INSTANCING
          #define USE_INSTANCING_COLOR
          uniform highp sampler2D places, tints;
          attribute float slot;
          mat4 instanceMatrix;
          vec3 instanceColor;`)
        .replace("void main() {", `void main() {
          int body = int(slot + 0.5), row = body / ${ROW}, column = body - ${ROW} * row;
          instanceMatrix = mat4(texelFetch(places, ivec2(4 * column, row), 0), texelFetch(places, ivec2(4 * column + 1, row), 0),
            texelFetch(places, ivec2(4 * column + 2, row), 0), texelFetch(places, ivec2(4 * column + 3, row), 0));
          instanceColor = texelFetch(tints, ivec2(column, row), 0).rgb;`);
      shader.fragmentShader = `#define USE_COLOR\n${shader.fragmentShader}`;
    };
    material.customProgramCacheKey = () => key;
    return material;
  }
}

/** The geometry so many times, with the number of the copy at each vertex. */
function copies(one: THREE.BufferGeometry, count: number): THREE.BufferGeometry {
  const all = new THREE.BufferGeometry(), vertices = one.getAttribute("position").count;
  for (const name of ["position", "normal", "uv"]) {
    const source = one.getAttribute(name);
    if (!source) continue;
    const array = new Float32Array(count * source.array.length);
    for (let i = 0; i < count; ++i) array.set(source.array, i * source.array.length);
    all.setAttribute(name, new THREE.BufferAttribute(array, source.itemSize));
  }
  const slots = new Float32Array(count * vertices);
  for (let i = 0; i < count; ++i) slots.fill(i, i * vertices, (i + 1) * vertices);
  all.setAttribute("slot", new THREE.BufferAttribute(slots, 1));
  const index = one.getIndex()?.array ?? Uint32Array.from({ length: vertices }, (_, i) => i);
  const indices = new Uint32Array(count * index.length);
  for (let i = 0; i < count; ++i)
    for (let k = 0; k < index.length; ++k) indices[i * index.length + k] = i * vertices + index[k];
  all.setIndex(new THREE.BufferAttribute(indices, 1));
  return all;
}
