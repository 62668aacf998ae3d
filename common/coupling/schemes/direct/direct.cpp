#include "coupling/schemes/direct/direct.hpp"

namespace subworld {

namespace {

class DirectWorldSide final : public WorldSide {
 public:
  ProxyDrive drive(const UserSpec& user, const Wrench&, const HapticReport&, const HapticReport& now,
                   double) const override {
    if (!now.device) return {};
    const ReportedDevice& device = *now.device;
    if (user.device.kind == DeviceKind::admittance) return {device.applied, std::nullopt, {}};
    return {{}, DevicePose{device.pose, device.linear_velocity, device.angular_velocity}, limits_of(user.device)};
  }
  void extract(const WorldNow&, const Inside&, Border&, WorldFrame&) override {}
};

Correction direct_correction(const CopyPair&, const Indicators&, const Settings&) noexcept { return {}; }

}  // namespace

constinit const Scheme kDirect{
    .properties = {.name = "direct", .summary = "no sub-world: the baseline", .has_sub_worlds = false},
    .correction = direct_correction,
    .make_world_side = [](const Scene&) -> std::unique_ptr<WorldSide> { return std::make_unique<DirectWorldSide>(); },
    .make_sub_world_side = [](const Scene&, std::uint64_t) -> std::unique_ptr<SubWorldSide> { return nullptr; }};

}  // namespace subworld
