#pragma once

#include <btBulletDynamicsCommon.h>

namespace subworld::bullet {

/// Makes boxes meet boxes with the same points from step to step. Bullet's own algorithm chooses four of up to eight
/// corners of the common face anew in every step, starting from the deepest: resting cubes rock on them, and the force
/// between two of a pile wanders by 6 %.
void register_box_box(btCollisionDispatcher& dispatcher);

}  // namespace subworld::bullet
