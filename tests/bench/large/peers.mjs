// The worlds of bench_large in other engines: node peers.mjs ENGINE FILE SECONDS [SUBSTEPS], with ENGINE `rapier` or
// `jolt`, and FILE of `bench_large --write FILE`. Steps of 1/60 s. Prints means in ms of CPU of one thread.
import { readFileSync } from 'node:fs';

const [engine, file, seconds, substeps] = process.argv.slice(2);
const bodies = JSON.parse(readFileSync(file, 'utf8'));
const dt = 1 / 60;

async function rapier() {
  const { default: R } = await import('@dimforge/rapier3d-simd-compat');
  await R.init();
  const world = new R.World({ x: 0, y: 0, z: -9.81 });
  world.timestep = dt;
  if (substeps) world.numSolverIterations = Number(substeps);
  const moving = [];
  for (const b of bodies) {
    const [x, y, z] = b.position;
    const [i, j, k, w] = b.orientation;
    const kind = b.mass > 0 ? R.RigidBodyDesc.dynamic() : R.RigidBodyDesc.fixed();
    const body = world.createRigidBody(kind.setTranslation(x, y, b.plane ? -50 : z).setRotation({ x: i, y: j, z: k, w }).setLinvel(...b.velocity).setCanSleep(false));
    const shape = b.plane ? R.ColliderDesc.cuboid(500, 500, 50) : b.radius ? R.ColliderDesc.ball(b.radius) : R.ColliderDesc.cuboid(...b.half);
    world.createCollider(shape.setMass(b.mass).setFriction(0.5).setRestitution(0), body);
    if (b.mass > 0) moving.push(body);
  }
  return { step: () => world.step(), speed: () => moving.map(b => Math.hypot(...Object.values(b.linvel()))) };
}

async function jolt() {
  const { default: load } = await import('jolt-physics');
  const J = await load();
  const settings = new J.JoltSettings();
  settings.mMaxWorkerThreads = 0;
  settings.mMaxBodies = 32768;
  settings.mMaxBodyPairs = 65536;
  settings.mMaxContactConstraints = 20480;
  const filter = new J.ObjectLayerPairFilterTable(2);
  filter.EnableCollision(0, 1);
  filter.EnableCollision(1, 1);
  const layers = new J.BroadPhaseLayerInterfaceTable(2, 2);
  layers.MapObjectToBroadPhaseLayer(0, new J.BroadPhaseLayer(0));
  layers.MapObjectToBroadPhaseLayer(1, new J.BroadPhaseLayer(1));
  settings.mObjectLayerPairFilter = filter;
  settings.mBroadPhaseLayerInterface = layers;
  settings.mObjectVsBroadPhaseLayerFilter = new J.ObjectVsBroadPhaseLayerFilterTable(layers, 2, filter, 2);
  const world = new J.JoltInterface(settings);
  const system = world.GetPhysicsSystem();
  system.SetGravity(new J.Vec3(0, 0, -9.81));
  const all = system.GetBodyInterface();
  const moving = [];
  for (const b of bodies) {
    const half = b.plane ? [500, 500, 50] : b.half;
    const shape = b.radius ? new J.SphereShape(b.radius) : new J.BoxShape(new J.Vec3(...half), 0.01);
    const at = new J.RVec3(b.position[0], b.position[1], b.plane ? -50 : b.position[2]);
    const moves = b.mass > 0;
    const made = new J.BodyCreationSettings(shape, at, new J.Quat(...b.orientation), moves ? J.EMotionType_Dynamic : J.EMotionType_Static, moves ? 1 : 0);
    made.mFriction = 0.5;
    made.mRestitution = 0;
    made.mAllowSleeping = false;
    if (moves) {
      made.mOverrideMassProperties = J.EOverrideMassProperties_CalculateInertia;
      made.mMassPropertiesOverride.mMass = b.mass;
      made.mLinearVelocity = new J.Vec3(...b.velocity);
    }
    const body = all.CreateBody(made);
    all.AddBody(body.GetID(), J.EActivation_Activate);
    if (moves) moving.push(body);
  }
  return { step: () => world.Step(dt, substeps ? Number(substeps) : 1), speed: () => moving.map(b => b.GetLinearVelocity().Length()) };
}

const world = await { rapier, jolt }[engine]();
const steps = Math.round(Number(seconds) / dt);
const began = process.cpuUsage(), wall = performance.now();
for (let i = 0; i < steps; ++i) world.step();
const { user, system } = process.cpuUsage(began);
const speeds = world.speed();
console.log(`${engine} ${bodies.length} bodies: ${((performance.now() - wall) / steps).toFixed(2)} ms of wall, ${((user + system) / 1e3 / steps).toFixed(2)} ms of CPU a step of ${(1e3 * dt).toFixed(1)} ms; mean speed at the end ${(speeds.reduce((a, b) => a + b, 0) / speeds.length).toFixed(3)} m/s`);
