#pragma once

#include <btBulletDynamicsCommon.h>

namespace subworld::bullet {

/// Box-plane contacts with all touching corners in every step. Bullet's own algorithm adds one corner a step and drops
/// those that slide, so that a new or sliding body would rock.
void register_box_plane(btCollisionDispatcher& dispatcher);

}  // namespace subworld::bullet
