// The smallest coupling scheme with a sub-world: nothing represents the outside at its border, the mean device force
// acts on the world's proxy, and the two copies of each body meet half way. See "Adding a scheme" in
// common/coupling/README.md.
#pragma once

#include "coupling/schemes/scheme.hpp"
#include "coupling/select/border.hpp"

namespace half_way {

using namespace subworld;

class InWorld final : public WorldSide {
 public:
  ProxyDrive drive(const UserSpec&, const Wrench& mean, const HapticReport&, const HapticReport&,
                   double) const override {
    return {mean, std::nullopt, {}};
  }
  void extract(const WorldNow& now, const Inside& inside, Border& border, WorldFrame&) override {
    extract_border(now.contacts, inside.membership, border.contacts);
  }
};

class InSubWorld final : public SubWorldSide {
 public:
  void follow(const WorldFrame&, Engine&, const Following&) override {}
  std::optional<BodyState> release(BodyId, Engine&) override { return std::nullopt; }
  void clear(Engine&) override {}
  void begin(Engine&, double, double, std::span<const PeerPull>) override {}
};

inline Correction correction(const CopyPair& pair, const Indicators&, const Settings&) noexcept {
  return pair.owner == Owner::user ? Correction{1.0, 0.0} : Correction{0.5, 0.5};
}

/// `add_scheme(half_way::kScheme)` makes it known by its name.
inline constinit const Scheme kScheme{
    .properties = {.name = "half_way", .summary = "nothing at the border, copies meet half way"},
    .correction = correction,
    .make_world_side = [](const Scene&) -> std::unique_ptr<WorldSide> { return std::make_unique<InWorld>(); },
    .make_sub_world_side = [](const Scene&, std::uint64_t) -> std::unique_ptr<SubWorldSide> {
      return std::make_unique<InSubWorld>();
    }};

}  // namespace half_way
