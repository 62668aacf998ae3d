#include "world_sim/border_extractor.hpp"

#include "coupling/border.hpp"

#include <optional>

namespace subworld {

namespace {

class NoBorder final : public BorderExtractor {
 public:
  void extract(const WorldNow&, const Inside&, std::vector<BoundaryContact>&, WorldFrame&) override {}
};

/// Contacts with their impulses (paper 4.2).
class FrozenBorder final : public BorderExtractor {
 public:
  void extract(const WorldNow& now, const Inside& inside, std::vector<BoundaryContact>& border, WorldFrame&) override {
    extract_border(now.contacts, inside.membership, border);
  }
};

/// Contacts, those too that may soon be, the reduced models of what is outside, and who hangs together.
class GhostBorder final : public BorderExtractor {
 public:
  explicit GhostBorder(const Scene& scene) : scene_(scene), approach_(scene), modeller_(scene) {}

  void extract(const WorldNow& now, const Inside& inside, std::vector<BoundaryContact>& border,
               WorldFrame& frame) override {
    // Friction of contacts costs an engine that estimates it time, and nobody but a border reads it.
    const auto find_contacts = [&] { extract_border(now.contacts, inside.membership, border); };
    find_contacts();
    if (!border.empty() && now.find_friction()) find_contacts();
    find_approaching(now, inside, border);
    if (!border.empty() && now.find_friction()) {  // what comes hangs on contacts
      find_contacts();
      find_approaching(now, inside, border);
    }
    modeller_.model(border, {inside.membership, now.graph, now.motions, now.cycle_s}, frame.ghosts);
    label_islands(now, inside, frame.islands);
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

  void label_islands(const WorldNow& now, const Inside& inside, std::vector<std::uint32_t>& labels) {
    islands_.begin(inside.membership.members);
    for (const Contact& c : now.contacts) {
      if (!scene_.body(c.a).fixed() && !scene_.body(c.b).fixed()) islands_.join(c.a, c.b);
    }
    for (const BodyId id : inside.membership.members) {
      if (inside.shared(id)) islands_.open(id);
    }
    islands_.labels(labels);
  }

  const Scene& scene_;
  ApproachFinder approach_;
  GhostModeller modeller_;
  Islands islands_;
};

}  // namespace

std::unique_ptr<BorderExtractor> make_border_extractor(const Scheme& scheme, const Scene& scene) {
  switch (scheme.border()) {
    case Border::none:
      return std::make_unique<NoBorder>();
    case Border::frozen:
      return std::make_unique<FrozenBorder>();
    case Border::ghosts:
      break;
  }
  return std::make_unique<GhostBorder>(scene);
}

}  // namespace subworld
