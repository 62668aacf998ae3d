#pragma once

#include <btBulletDynamicsCommon.h>

namespace subworld::bullet {

/// Makes boxes meet planes with all their corners at every step. Bullet's own algorithm adds one corner a step and
/// drops those that slide: a body that has just been added, or slides, would rock.
void register_box_plane(btCollisionDispatcher& dispatcher);

}  // namespace subworld::bullet
