#include "support/example_scheme/example_scheme.hpp"

#include "coupling/select/border.hpp"

namespace subworld::test {

namespace {

class ExampleWorldSide final : public WorldSide {
 public:
  ProxyDrive drive(const UserSpec&, const Wrench& mean, const HapticReport&, const HapticReport&,
                   double) const override {
    return {mean, std::nullopt, {}};
  }
  void extract(const WorldNow& now, const Inside& inside, Border& border, WorldFrame&) override {
    extract_border(now.contacts, inside.membership, border.contacts);
  }
};

class NothingOutside final : public SubWorldSide {
 public:
  void follow(const WorldFrame&, Engine&, const Following&) override {}
  std::optional<BodyState> release(BodyId, Engine&) override { return std::nullopt; }
  void clear(Engine&) override {}
  void begin(Engine&, double, double, std::span<const PeerPull>) override {}
};

Correction correction(const CopyPair& pair, const Indicators&, const Settings&) noexcept {
  return pair.owner == Owner::user ? Correction{1.0, 0.0} : Correction{0.5, 0.5};
}

}  // namespace

constinit const Scheme kExampleScheme{
    .properties = {.name = "example", .summary = "nothing at the border, copies meet half way"},
    .correction = correction,
    .make_world_side = [](const Scene&) -> std::unique_ptr<WorldSide> { return std::make_unique<ExampleWorldSide>(); },
    .make_sub_world_side = [](const Scene&, std::uint64_t) -> std::unique_ptr<SubWorldSide> {
      return std::make_unique<NothingOutside>();
    }};

}  // namespace subworld::test
