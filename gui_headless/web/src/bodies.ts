// All bodies: one instanced mesh for each shape, so that thousands cost a few draw calls.
import * as THREE from "three";
import { BODY_PIXELS, bodyLitAtCorners } from "./corner_light";
import { Merged } from "./merged";
import { SHAPES, type Body, type Mesh, type Model, type Vector } from "./model";
import { theme, userColour } from "./theme";
import { VisibleFaces, type Light } from "./visible_faces";

type Group = {
  mesh: THREE.InstancedMesh; merged?: Merged; faces?: VisibleFaces; lit: THREE.Material; cornerLit?: THREE.Material;
  ids: number[]; scales: THREE.Vector3[]; fixed: boolean;
  moved: Uint8Array; painted: Uint8Array; // of each block of instances, since the last upload
};

const BLOCK = 64; // instances that are uploaded together
const MANY = 500; // bodies of one shape, which then has fewer triangles
const UP = new THREE.Vector3(0, 0, 1);
const SELECTED = new THREE.Color("#ffd23f");
const PLAIN = new THREE.Color();

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

/** Geometry for that many bodies, its key, and the scale that makes it the body's shape. */
function shapeOf(body: Body, meshes: Mesh[]): { key: string; make: (count: number) => THREE.BufferGeometry; scale: THREE.Vector3 } {
  const { radius: r, half_length: h, half_extents: e } = body;
  switch (SHAPES[body.shape]) {
    case "sphere":
      return { key: "sphere", make: (n) => new THREE.SphereGeometry(1, ...(n > MANY ? [14, 9] : [28, 20])), scale: new THREE.Vector3(r, r, r) };
    case "box":
      return { key: "box", make: () => new THREE.BoxGeometry(2, 2, 2), scale: new THREE.Vector3(e.x, e.y, e.z) };
    case "cylinder":
      return {
        key: "cylinder", make: (n) => alongZ(new THREE.CylinderGeometry(1, 1, 2, n > MANY ? 16 : 36)), scale: new THREE.Vector3(r, r, h),
      };
    case "capsule":
      return {
        key: `capsule ${(h / r).toFixed(4)}`, make: (n) => alongZ(new THREE.CapsuleGeometry(1, (2 * h) / r, ...(n > MANY ? [4, 14] : [10, 28]))),
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
  /** A processor draws: a shape's bodies are one mesh in the place of instances, and light is at corners where no shadows are. */
  software = false;
  light?: Light;
  /** Instances whose place has changed in the last frame. */
  placed = 0;
  private groups: Group[] = [];
  private poses = new Float64Array(0);
  // Of each body: its group and its number there; -1: the floor.
  private groupOf = new Int32Array(0);
  private slotOf = new Int32Array(0);
  private tints = new Map<number, number>();
  private shadows = true;

  build(model: Model): void {
    for (const { mesh, merged, faces, lit, cornerLit } of this.groups) {
      merged?.dispose();
      faces?.dispose();
      mesh.geometry.dispose();
      lit.dispose();
      cornerLit?.dispose();
      mesh.dispose();
    }
    this.root.clear();
    this.groups = [];
    this.floor = null;
    this.poses = new Float64Array(model.states.to);
    this.groupOf = new Int32Array(model.bodies.length).fill(-1);
    this.slotOf = new Int32Array(model.bodies.length);
    const kinds = new Map<string, { bodies: Body[]; scales: THREE.Vector3[]; make: (count: number) => THREE.BufferGeometry }>();
    for (const body of model.bodies) {
      if (this.isFloor(model, body)) continue;
      const { key, make, scale } = shapeOf(body, model.meshes);
      const place = model.isFixed(body) ? (isWall(body) ? "wall" : "ground") : "free";
      const kind = kinds.get(`${place} ${key}`) ?? { bodies: [], scales: [], make };
      kind.bodies.push(body);
      kind.scales.push(scale);
      kinds.set(`${place} ${key}`, kind);
    }
    for (const [key, { bodies, scales, make }] of kinds) this.add(key, bodies, scales, make(bodies.length));
    for (const body of model.bodies) this.compose(body.id);
    this.shade(this.shadows);
    this.repaint(model);
  }

  /** With shadows, or without. */
  shade(shadows: boolean): void {
    this.shadows = shadows;
    for (const { mesh, merged, faces, lit, cornerLit } of this.groups) {
      (merged?.mesh ?? mesh).material = shadows ? lit : cornerLit ?? lit;
      if (!merged || !faces) continue;
      merged.mesh.visible = shadows;
      faces.mesh.visible = !shadows;
    }
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
    const hasEdges = key.endsWith("box") && !wall, material = hasEdges ? edged(plain) : plain;
    const merges = this.software && !wall && Merged.suits(geometry, bodies.length);
    const mesh = new THREE.InstancedMesh(geometry, material, merges ? Merged.roomFor(bodies.length) : bodies.length);
    mesh.count = bodies.length;
    mesh.instanceMatrix.setUsage(THREE.DynamicDrawUsage);
    mesh.castShadow = !wall;
    mesh.receiveShadow = !wall;
    mesh.frustumCulled = false;
    mesh.renderOrder = wall ? 1 : 0;
    mesh.setColorAt(0, SELECTED);
    const merged = merges ? new Merged(mesh) : undefined;
    const faces = merged && hasEdges ? new VisibleFaces(bodies.length, BODY_PIXELS, { EDGES: "" }) : undefined;
    const corners = this.software && !faces ? bodyLitAtCorners(plain, hasEdges) : undefined;
    if (corners) merged?.placed(corners);
    const blocks = Math.ceil(bodies.length / BLOCK);
    bodies.forEach((body, slot) => {
      this.groupOf[body.id] = this.groups.length;
      this.slotOf[body.id] = slot;
    });
    this.groups.push({ mesh, merged, faces, lit: material, cornerLit: corners, ids: bodies.map((one) => one.id), scales, fixed,
      moved: new Uint8Array(blocks), painted: new Uint8Array(blocks) });
    this.root.add(mesh);
    if (merged) this.root.add(merged.mesh);
    if (faces) this.root.add(faces.mesh);
  }

  /** Moves the instances to where the bodies are now. Only those are touched that move. */
  place(model: Model, now_ms: number, eye: THREE.Vector3): void {
    const { states } = model, { shown } = states;
    states.show(this.poses, now_ms);
    this.placed = states.shownCount;
    for (let i = 0; i < states.shownCount; ++i) this.compose(shown[i]);
    for (const { mesh, merged, faces, moved, painted } of this.groups) {
      if (faces?.mesh.visible && this.light) faces.update(mesh.instanceMatrix.array, mesh.instanceColor!.array, eye, this.light);
      if (moved.includes(1)) {
        mesh.boundingSphere = null;
        if (merged) merged.move();
        else upload(mesh.instanceMatrix, moved);
      }
      if (!merged && painted.includes(1)) upload(mesh.instanceColor!, painted);
      moved.fill(0);
      painted.fill(0);
    }
  }

  private compose(id: number): void {
    const group = this.groups[this.groupOf[id]], slot = this.slotOf[id];
    if (!group) return;
    compose(group.mesh.instanceMatrix.array, 16 * slot, this.poses, 7 * id, group.scales[slot]);
    group.moved[Math.floor(slot / BLOCK)] = 1;
    group.faces?.touch(slot);
  }

  position(id: number, into: THREE.Vector3): THREE.Vector3 {
    return into.fromArray(this.poses as unknown as number[], 7 * id);
  }

  orientation(id: number, into: THREE.Quaternion): THREE.Quaternion {
    return into.fromArray(this.poses as unknown as number[], 7 * id + 3);
  }

  /** Members have the colour of their user, bodies at the border a lighter one. Only those are touched that change. */
  paint(model: Model): void {
    const plain = new THREE.Color(theme().body), tints = new Map<number, number>();
    const tint = (id: number, colour: THREE.Color) => tints.set(id, colour.getHex());
    for (const user of model.users) {
      const own = new THREE.Color(userColour(user.user)), border = own.clone().lerp(plain, 0.58);
      for (const pair of user.border)
        for (const id of [pair.inside, pair.outside])
          if (model.bodies[id] && !model.isFixed(model.bodies[id])) tint(id, border);
      own.lerp(plain, 0.12);
      for (const id of user.members) tint(id, own);
    }
    for (const user of model.users) tint(user.proxy, new THREE.Color(userColour(user.user)).multiplyScalar(0.6));
    if (this.selected >= 0) tint(this.selected, SELECTED);
    for (const id of this.tints.keys()) if (!tints.has(id)) this.colour(id, this.plainOf(model, id));
    for (const [id, colour] of tints) if (this.tints.get(id) !== colour) this.colour(id, colour);
    this.tints = tints;
  }

  /** All bodies, as where the theme has changed. */
  repaint(model: Model): void {
    this.tints.clear();
    for (const { id } of model.bodies) this.colour(id, this.plainOf(model, id));
    this.paint(model);
  }

  private plainOf(model: Model, id: number): number {
    const body = model.bodies[id];
    return (PLAIN.set(body && model.isFixed(body) ? theme().fixed : theme().body)).getHex();
  }

  private colour(id: number, colour: number): void {
    const group = this.groups[this.groupOf[id]];
    if (!group) return;
    group.faces?.touch(this.slotOf[id]);
    group.merged?.colour(this.slotOf[id], PLAIN.setHex(colour));
    group.mesh.setColorAt(this.slotOf[id], PLAIN.setHex(colour));
    group.painted[Math.floor(this.slotOf[id] / BLOCK)] = 1;
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

/** Uploads the blocks that have changed, with the next frame. */
function upload(attribute: THREE.InstancedBufferAttribute, changed: Uint8Array): void {
  const size = BLOCK * attribute.itemSize;
  changed.forEach((one, block) => {
    if (one) attribute.addUpdateRange(size * block, Math.min(size, attribute.array.length - size * block));
  });
  attribute.needsUpdate = true;
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
