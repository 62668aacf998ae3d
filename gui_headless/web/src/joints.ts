// Marks of joints, in front of all bodies. The server says where on the bodies they are.
import * as THREE from "three";
import type { Bodies } from "./bodies";
import type { JointMark } from "./model";
import { JOINT } from "./theme";

const FORMS = [ // unit solids, z along a rod
  new THREE.BoxGeometry(2, 2, 2), new THREE.SphereGeometry(1, 20, 14),
  new THREE.CylinderGeometry(1, 1, 2, 20).rotateX(Math.PI / 2),
];
const ROD = 2;

export class Joints {
  readonly root = new THREE.Group();
  /** Marks that the last frame had. */
  shown = 0;
  private marks: JointMark[] = [];
  private meshes: THREE.InstancedMesh[] = [];
  private readonly material = new THREE.MeshBasicMaterial({ color: JOINT, depthTest: false, transparent: true, toneMapped: false });

  build(marks: JointMark[]): void {
    this.root.clear();
    for (const mesh of this.meshes) mesh.dispose();
    this.marks = marks;
    this.meshes = FORMS.map((solid, form) => {
      const mesh = new THREE.InstancedMesh(solid, this.material, marks.filter((one) => one.form === form).length);
      mesh.frustumCulled = false;
      mesh.renderOrder = 3;
      this.root.add(mesh);
      return mesh;
    });
  }

  /** Moves the marks to where the bodies are now. Those of broken joints are not drawn. */
  place(bodies: Bodies, broken: number[]): void {
    const matrix = new THREE.Matrix4(), at = new THREE.Vector3(), turn = new THREE.Quaternion(), size = new THREE.Vector3();
    const part = new THREE.Vector3(), of = new THREE.Quaternion(), gone = new Set(broken);
    for (const mesh of this.meshes) mesh.count = 0;
    for (const { joint, form, at: body, along, point, turn: own, shift, radius, half_length } of this.marks) {
      const mesh = this.meshes[form];
      if (gone.has(joint) || !mesh) continue;
      bodies.position(body, at).add(part.copy(point as THREE.Vector3).applyQuaternion(bodies.orientation(body, turn)));
      bodies.orientation(along, turn).multiply(of.set(own.x, own.y, own.z, own.w));
      at.add(part.set(0, 0, shift).applyQuaternion(turn));
      mesh.setMatrixAt(mesh.count++, matrix.compose(at, turn, size.set(radius, radius, form === ROD ? half_length : radius)));
    }
    this.shown = this.meshes.reduce((sum, mesh) => sum + mesh.count, 0);
    for (const mesh of this.meshes) {
      mesh.visible = mesh.count > 0;
      mesh.instanceMatrix.needsUpdate = true;
    }
  }
}
