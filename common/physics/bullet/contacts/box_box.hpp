#pragma once

#include <btBulletDynamicsCommon.h>

namespace subworld::bullet {

/// Box-box contacts with the same points from step to step. Bullet's own algorithm chooses four of up to eight corners
/// of the common face again in every step, starting from the deepest. Then resting cubes rock, and the force between
/// two bodies of a pile varies by 6 %.
void register_box_box(btCollisionDispatcher& dispatcher);

}  // namespace subworld::bullet
