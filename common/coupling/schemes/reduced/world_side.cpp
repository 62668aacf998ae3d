#include "coupling/schemes/reduced/approach.hpp"
#include "coupling/schemes/reduced/ghost_model.hpp"
#include "coupling/schemes/reduced/reduced.hpp"
#include "coupling/select/border.hpp"
#include "coupling/sync/authority.hpp"

#include <optional>

namespace subworld {

namespace {

/// The border of a frame: contacts, contacts to come, the ghosts' models and the islands.
class ReducedWorldSide final : public WorldSide {
 public:
  explicit ReducedWorldSide(const Scene& scene) : scene_(scene), approach_(scene), modeller_(scene) {
    contacts_.reserve(kUsualContacts);
    swept_.reserve(scene.bodies.size());
  }

  ProxyDrive drive(const UserSpec& user, const Wrench& mean, const HapticReport& before, const HapticReport& now,
                   double until_s) const override {
    return reduced_drive(user, mean, before, now, until_s);
  }

  void begin(const WorldNow&) override { swept_for_s_ = kNever_s; }
  void extract(const WorldNow& now, const Inside& inside, Border& border, WorldFrame& frame) override {
    // Only a border reads the friction of contacts, and some engines must estimate it.
    std::vector<BoundaryContact>& pairs = border.contacts;
    const auto find_contacts = [&] {
      now.graph.contacts_of(inside.membership.members, contacts_);
      extract_border(contacts_, inside.membership, pairs);
    };
    find_contacts();
    if (!pairs.empty() && now.find_friction()) find_contacts();
    find_approaching(now, inside, pairs);
    if (!pairs.empty() && now.find_friction()) {  // an approaching body may rest on contacts
      find_contacts();
      find_approaching(now, inside, pairs);
    }
    modeller_.model(pairs, {inside.membership, now.graph, now.motions, now.cycle_s, now.pulls}, frame.ghosts,
                    frame.ghost_peers);
    border.outside.clear();
    for (const GhostModel& ghost : frame.ghosts) border.outside.push_back({ghost.outside, ghost.carried.has_value()});
    border.pushing.clear();
    for (const GhostPeer& peer : frame.ghost_peers) border.pushing.push_back(peer.proxy);
    Authority::label(scene_, islands_, inside.membership.members, contacts_, inside.shared, frame.islands);
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
    if (inside.horizon_s != swept_for_s_) sweep(now, inside.horizon_s);
    std::optional<Box> where = reach;
    while (where) {
      for (const Swept& awake : swept_) {
        if (!awake.box.meets(*where) || !approach_.may_come(awake.id)) continue;
        approach_.outside(awake.id, now.motions[index(awake.id)].state, now.engine.bounds(awake.id), *where);
      }
      where = approach_.find(inside.membership, now.graph, border);
    }
  }

  /// Where what is awake may get within the time. The same for all users whose next frame comes at the same time.
  void sweep(const WorldNow& now, double horizon_s) {
    swept_for_s_ = horizon_s;
    swept_.clear();
    const double gravity_m_s2 = scene_.settings.world.gravity.norm();
    for (const BodyId id : now.engine.awake()) {
      swept_.push_back(
          {id, swept_bounds(now.motions[index(id)].state, now.engine.bounds(id), gravity_m_s2, horizon_s)});
    }
  }

  struct Swept {
    BodyId id{};
    Box box;
  };
  static constexpr double kNever_s = -1.0;

  const Scene& scene_;
  std::vector<Contact> contacts_;  ///< of the members
  std::vector<Swept> swept_;       ///< in the order of the ids
  double swept_for_s_ = kNever_s;
  ApproachFinder approach_;
  GhostModeller modeller_;
  Islands islands_;
};

}  // namespace

std::unique_ptr<WorldSide> make_reduced_world_side(const Scene& scene) {
  return std::make_unique<ReducedWorldSide>(scene);
}

}  // namespace subworld
