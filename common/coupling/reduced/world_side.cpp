#include "coupling/authority.hpp"
#include "coupling/border.hpp"
#include "coupling/reduced/approach.hpp"
#include "coupling/reduced/ghost_model.hpp"
#include "coupling/reduced/reduced.hpp"

#include <optional>

namespace subworld {

namespace {

/// The border of a frame: contacts, contacts to come, the ghosts' models and the islands.
class ReducedWorldSide final : public WorldSide {
 public:
  explicit ReducedWorldSide(const Scene& scene) : scene_(scene), approach_(scene), modeller_(scene) {}

  ProxyDrive drive(const UserSpec& user, const Wrench& mean, const HapticReport& before, const HapticReport& now,
                   double until_s) const override {
    return reduced_drive(user, mean, before, now, until_s);
  }

  void extract(const WorldNow& now, const Inside& inside, std::vector<BoundaryContact>& border,
               WorldFrame& frame) override {
    // Only a border reads the friction of contacts, and some engines must estimate it.
    const auto find_contacts = [&] { extract_border(now.contacts, inside.membership, border); };
    find_contacts();
    if (!border.empty() && now.find_friction()) find_contacts();
    find_approaching(now, inside, border);
    if (!border.empty() && now.find_friction()) {  // an approaching body may rest on contacts
      find_contacts();
      find_approaching(now, inside, border);
    }
    modeller_.model(border, {inside.membership, now.graph, now.motions, now.cycle_s, now.pulls}, frame.ghosts,
                    frame.ghost_peers);
    Authority::label(scene_, islands_, inside.membership.members, now.contacts, inside.shared, frame.islands);
  }

 private:
  void find_approaching(const WorldNow& now, const Inside& inside, std::vector<BoundaryContact>& border) {
    Box reach = inside.reach;
    approach_.begin(inside.horizon_s);
    for (const BodyId id : inside.membership.members) {
      approach_.inside(id, now.engine.state(id), now.engine.bounds(id));
    }
    for (const BodyId id : approach_.touching(inside.membership, now.graph, border)) {
      reach.extend(approach_.ghost(id, now.engine.state(id), now.engine.bounds(id)));
    }
    std::optional<Box> where = reach;
    while (where) {
      for (const BodyId id : now.engine.awake()) {
        if (!approach_.may_come(id)) continue;
        approach_.outside(id, now.motions[index(id)].state, now.engine.bounds(id), *where);
      }
      where = approach_.find(inside.membership, now.graph, border);
    }
  }

  const Scene& scene_;
  ApproachFinder approach_;
  GhostModeller modeller_;
  Islands islands_;
};

}  // namespace

std::unique_ptr<WorldSide> make_reduced_world_side(const Scene& scene) {
  return std::make_unique<ReducedWorldSide>(scene);
}

}  // namespace subworld
