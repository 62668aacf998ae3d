// All bodies: one instanced mesh for each shape, so that thousands cost a few draw calls.
import * as THREE from "three";
import { SHAPES, type Body, type Mesh, type Model, type Vector } from "./model";
import { theme, userColour } from "./theme";

type Group = { mesh: THREE.InstancedMesh; ids: number[]; scales: THREE.Vector3[]; fixed: boolean };

const UP = new THREE.Vector3(0, 0, 1);
const SELECTED = new THREE.Color("#ffd23f");

/** Darkens the edges of unit boxes, so that equal neighbours stay distinct. */
function edged(material: THREE.MeshLambertMaterial): THREE.MeshLambertMaterial {
  material.onBeforeCompile = (shader) => {
    shader.vertexShader = shader.vertexShader
      .replace("#include <common>", "#include <common>\nvarying vec2 vFace;")
      .replace("#include <begin_vertex>", "#include <begin_vertex>\nvFace = uv;");
    shader.fragmentShader = shader.fragmentShader
      .replace("#include <common>", "#include <common>\nvarying vec2 vFace;")
      .replace("#include <color_fragment>", `#include <color_fragment>
        vec2 side = min(vFace, 1.0 - vFace);
        vec2 blur = fwidth(vFace);
        float edge = min(side.x / (0.035 + blur.x), side.y / (0.035 + blur.y));
        diffuseColor.rgb *= mix(0.66, 1.0, smoothstep(0.25, 1.1, edge));`);
  };
  return material;
}

function alongZ(geometry: THREE.BufferGeometry): THREE.BufferGeometry {
  return geometry.rotateX(Math.PI / 2);
}

function trianglesOf(mesh: Mesh): THREE.BufferGeometry {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position",
    new THREE.Float32BufferAttribute(mesh.vertices.flatMap((v) => [v.x, v.y, v.z]), 3));
  geometry.setIndex(mesh.triangles.flatMap((t) => [t.a, t.b, t.c]));
  const flat = geometry.toNonIndexed();
  flat.computeVertexNormals();
  return flat;
}

/** Geometry, its key, and the scale that makes it the body's shape. */
function shapeOf(body: Body, meshes: Mesh[]): { key: string; make: () => THREE.BufferGeometry; scale: THREE.Vector3 } {
  const { radius: r, half_length: h, half_extents: e } = body;
  switch (SHAPES[body.shape]) {
    case "sphere":
      return { key: "sphere", make: () => new THREE.SphereGeometry(1, 28, 20), scale: new THREE.Vector3(r, r, r) };
    case "box":
      return { key: "box", make: () => new THREE.BoxGeometry(2, 2, 2), scale: new THREE.Vector3(e.x, e.y, e.z) };
    case "cylinder":
      return {
        key: "cylinder", make: () => alongZ(new THREE.CylinderGeometry(1, 1, 2, 36)), scale: new THREE.Vector3(r, r, h),
      };
    case "capsule":
      return {
        key: `capsule ${(h / r).toFixed(4)}`, make: () => alongZ(new THREE.CapsuleGeometry(1, (2 * h) / r, 10, 28)),
        scale: new THREE.Vector3(r, r, r),
      };
    case "plane":
      return { key: "plane", make: () => new THREE.PlaneGeometry(1, 1), scale: new THREE.Vector3(6, 6, 1) };
    default: {
      const mesh = meshes[body.mesh];
      return {
        key: `mesh ${body.mesh}`, make: () => (mesh ? trianglesOf(mesh) : new THREE.BufferGeometry()),
        scale: new THREE.Vector3(1, 1, 1),
      };
    }
  }
}

export function radiusOf(body: Body, meshes: Mesh[]): number {
  switch (SHAPES[body.shape]) {
    case "sphere": return body.radius;
    case "box": return Math.hypot(body.half_extents.x, body.half_extents.y, body.half_extents.z);
    case "capsule": return body.radius + body.half_length;
    case "cylinder": return Math.hypot(body.radius, body.half_length);
    case "plane": return 0;
    default:
      return Math.max(0, ...(meshes[body.mesh]?.vertices ?? []).map((v) => Math.hypot(v.x, v.y, v.z)));
  }
}

/** A wall is seen through; a fixed body that is flat is ground. */
function isWall(body: Body): boolean {
  if (SHAPES[body.shape] === "plane") return true;
  const e = body.half_extents;
  return SHAPES[body.shape] === "box" && e.z > 0.5 * Math.min(e.x, e.y);
}

export class Bodies {
  readonly root = new THREE.Group();
  /** Height of the horizontal plane below all bodies, if there is one. */
  floor: number | null = null;
  selected = -1;
  private groups: Group[] = [];
  private poses = new Float64Array(0);
  private readonly colours: THREE.Color[] = [];

  build(model: Model): void {
    for (const { mesh } of this.groups) {
      mesh.geometry.dispose();
      (mesh.material as THREE.Material).dispose();
      mesh.dispose();
    }
    this.root.clear();
    this.groups = [];
    this.floor = null;
    this.poses = new Float64Array(7 * model.bodies.length);
    this.colours.length = 0;
    const kinds = new Map<string, { bodies: Body[]; scales: THREE.Vector3[]; make: () => THREE.BufferGeometry }>();
    for (const body of model.bodies) {
      this.colours.push(new THREE.Color());
      if (this.isFloor(model, body)) continue;
      const { key, make, scale } = shapeOf(body, model.meshes);
      const place = model.isFixed(body) ? (isWall(body) ? "wall" : "ground") : "free";
      const kind = kinds.get(`${place} ${key}`) ?? { bodies: [], scales: [], make };
      kind.bodies.push(body);
      kind.scales.push(scale);
      kinds.set(`${place} ${key}`, kind);
    }
    for (const [key, { bodies, scales, make }] of kinds) this.add(key, bodies, scales, make());
    this.place(model, 0, true);
  }

  private isFloor(model: Model, body: Body): boolean {
    if (SHAPES[body.shape] !== "plane" || this.floor !== null) return false;
    const at = 7 * body.id, pose = model.states.to;
    const turn = new THREE.Quaternion(pose[at + 3], pose[at + 4], pose[at + 5], pose[at + 6]);
    if (UP.clone().applyQuaternion(turn).z < 0.9999) return false;
    this.floor = pose[at + 2];
    return true;
  }

  private add(key: string, bodies: Body[], scales: THREE.Vector3[], geometry: THREE.BufferGeometry): void {
    const wall = key.startsWith("wall"), fixed = !key.startsWith("free");
    const plain = new THREE.MeshLambertMaterial({
      transparent: wall, opacity: wall ? 0.1 : 1, depthWrite: !wall,
      side: key.includes("mesh") || key.includes("plane") ? THREE.DoubleSide : THREE.FrontSide,
    });
    const material = key.endsWith("box") && !wall ? edged(plain) : plain;
    const mesh = new THREE.InstancedMesh(geometry, material, bodies.length);
    mesh.instanceMatrix.setUsage(THREE.DynamicDrawUsage);
    mesh.castShadow = !wall;
    mesh.receiveShadow = !wall;
    mesh.frustumCulled = false;
    mesh.renderOrder = wall ? 1 : 0;
    this.groups.push({ mesh, ids: bodies.map((one) => one.id), scales, fixed });
    this.root.add(mesh);
  }

  /** Moves the instances to where the bodies are now; fixed ones only if `all`. */
  place(model: Model, now_ms: number, all = false): void {
    model.states.pose(this.poses, now_ms);
    for (const group of this.groups) {
      if (group.fixed && !all) continue;
      const matrices = group.mesh.instanceMatrix.array;
      group.ids.forEach((id, i) => compose(matrices, 16 * i, this.poses, 7 * id, group.scales[i]));
      group.mesh.instanceMatrix.needsUpdate = true;
      group.mesh.boundingSphere = null;
    }
  }

  position(id: number, into: THREE.Vector3): THREE.Vector3 {
    return into.fromArray(this.poses as unknown as number[], 7 * id);
  }

  orientation(id: number, into: THREE.Quaternion): THREE.Quaternion {
    return into.fromArray(this.poses as unknown as number[], 7 * id + 3);
  }

  /** Members have the colour of their user, bodies at the border a lighter one. */
  paint(model: Model): void {
    const { body: plain, fixed } = theme();
    const plainColour = new THREE.Color(plain), fixedColour = new THREE.Color(fixed);
    model.bodies.forEach((body, id) => this.colours[id].copy(model.isFixed(body) ? fixedColour : plainColour));
    for (const user of model.users) {
      const own = new THREE.Color(userColour(user.user)), border = own.clone().lerp(plainColour, 0.58);
      for (const pair of user.border)
        for (const id of [pair.inside, pair.outside])
          if (this.colours[id] && !model.isFixed(model.bodies[id])) this.colours[id].copy(border);
      for (const id of user.members) this.colours[id]?.copy(own).lerp(plainColour, 0.12);
    }
    for (const user of model.users) this.colours[user.proxy]?.copy(new THREE.Color(userColour(user.user)).multiplyScalar(0.6));
    if (this.selected >= 0) this.colours[this.selected]?.copy(SELECTED);
    for (const group of this.groups) {
      group.ids.forEach((id, i) => group.mesh.setColorAt(i, this.colours[id]));
      if (group.mesh.instanceColor) group.mesh.instanceColor.needsUpdate = true;
    }
  }

  /** The body under the ray, movable ones before fixed ones; -1: none. */
  pick(ray: THREE.Raycaster): number {
    for (const fixed of [false, true]) {
      const meshes = this.groups.filter((one) => one.fixed === fixed);
      const [hit] = ray.intersectObjects(meshes.map((one) => one.mesh), false);
      const group = meshes.find((one) => one.mesh === hit?.object);
      if (group && hit.instanceId !== undefined) return group.ids[hit.instanceId];
    }
    return -1;
  }
}

/** The matrix of a pose and a scale. */
function compose(out: ArrayLike<number>, o: number, pose: Float64Array, p: number, scale: Vector): void {
  const m = out as Float32Array;
  const x = pose[p + 3], y = pose[p + 4], z = pose[p + 5], w = pose[p + 6];
  const xx = 2 * x * x, yy = 2 * y * y, zz = 2 * z * z, xy = 2 * x * y, xz = 2 * x * z, yz = 2 * y * z;
  const wx = 2 * w * x, wy = 2 * w * y, wz = 2 * w * z;
  m[o] = (1 - yy - zz) * scale.x;
  m[o + 1] = (xy + wz) * scale.x;
  m[o + 2] = (xz - wy) * scale.x;
  m[o + 3] = 0;
  m[o + 4] = (xy - wz) * scale.y;
  m[o + 5] = (1 - xx - zz) * scale.y;
  m[o + 6] = (yz + wx) * scale.y;
  m[o + 7] = 0;
  m[o + 8] = (xz + wy) * scale.z;
  m[o + 9] = (yz - wx) * scale.z;
  m[o + 10] = (1 - xx - yy) * scale.z;
  m[o + 11] = 0;
  m[o + 12] = pose[p];
  m[o + 13] = pose[p + 1];
  m[o + 14] = pose[p + 2];
  m[o + 15] = 1;
}
