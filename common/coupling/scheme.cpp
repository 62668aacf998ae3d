#include "coupling/scheme.hpp"

#include "coupling/blend.hpp"
#include "model/error.hpp"

#include <fmt/format.h>

#include <array>
#include <string>

namespace subworld {

namespace {

/// No sub-world: the world holds the proxy by an implicit coupling to the device's newest pose.
class Direct final : public Scheme {
 public:
  explicit Direct(const Settings&) {}
  std::string_view name() const noexcept override { return "direct"; }
  bool has_sub_world() const noexcept override { return false; }
  ProxyDrive drive(const UserSpec& user, const HapticReport& report, double) const override {
    if (user.device.kind == DeviceKind::admittance) return {.wrench = report.device_applied, .device = std::nullopt};
    return {.wrench = {},
            .device = DevicePose{report.device_pose, report.device_linear_velocity, report.device_angular_velocity}};
  }
  void border_impulses(const WorldFrame&, double, std::vector<PointImpulse>& out) const override { out.clear(); }
  double sub_weight(bool, const Indicators&) const noexcept override { return 0.0; }
};

/// The paper's scheme (4.1 to 4.3): frozen border impulses, blend by the four indicators.
class Paper final : public Scheme {
 public:
  explicit Paper(const Settings& settings) : settings_(settings.paper) {}
  std::string_view name() const noexcept override { return "paper"; }
  bool has_sub_world() const noexcept override { return true; }
  ProxyDrive drive(const UserSpec&, const HapticReport& report, double cycle_s) const override {
    if (!settings_.device_force_in_world) return {};
    return {.wrench = {report.impulse.force / cycle_s, report.impulse.torque / cycle_s}, .device = std::nullopt};
  }
  void border_impulses(const WorldFrame& frame, double fraction, std::vector<PointImpulse>& out) const override {
    frozen_impulses(frame.border, fraction, out);
  }
  double sub_weight(bool is_proxy, const Indicators& indicators) const noexcept override {
    return is_proxy ? 1.0 : blend_weight(indicators, settings_);
  }

 private:
  PaperSettings settings_;
};

template <class S>
std::unique_ptr<Scheme> make(const Settings& settings) {
  return std::make_unique<S>(settings);
}

struct Maker {
  std::string_view name;
  std::unique_ptr<Scheme> (*make)(const Settings&);
};

constexpr std::array kMakers{Maker{"direct", make<Direct>}, Maker{"paper", make<Paper>}};

}  // namespace

std::unique_ptr<Scheme> make_scheme(const Settings& settings) {
  std::string known;
  for (const Maker& maker : kMakers) {
    if (maker.name == settings.scheme) return maker.make(settings);
    known += fmt::format("{}{}", known.empty() ? "" : ", ", maker.name);
  }
  throw Error(ExitCode::usage, fmt::format("scheme \"{}\" is unknown; choose one of: {}", settings.scheme, known));
}

}  // namespace subworld
