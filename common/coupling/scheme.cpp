#include "coupling/scheme.hpp"

#include "coupling/blend.hpp"
#include "model/error.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

namespace subworld {

namespace {

/// No sub-world: the world holds the proxy by an implicit coupling to the device's newest pose.
class Direct final : public Scheme {
 public:
  explicit Direct(const Settings&) {}
  std::string_view name() const noexcept override { return "direct"; }
  Border border() const noexcept override { return Border::none; }
  bool replicates_peers() const noexcept override { return false; }
  int lead_cycles() const noexcept override { return 0; }
  double longest_world_step_s() const noexcept override { return INFINITY; }
  ProxyDrive drive(const UserSpec& user, const HapticReport&, const HapticReport& now, double) const override {
    if (!now.device) return {};
    const ReportedDevice& device = *now.device;
    if (user.device.kind == DeviceKind::admittance) return {device.applied, std::nullopt, {}};
    return {{}, DevicePose{device.pose, device.linear_velocity, device.angular_velocity}, limits_of(user.device)};
  }
  bool corrects_gradually() const noexcept override { return false; }
  Correction correction(const CopyPair&, const Indicators&) const noexcept override { return {}; }
};

/// The paper's scheme (4.1 to 4.3): frozen border impulses, blend by the four indicators.
class Paper final : public Scheme {
 public:
  explicit Paper(const Settings& settings) : settings_(settings.paper) {}
  std::string_view name() const noexcept override { return "paper"; }
  Border border() const noexcept override { return Border::frozen; }
  bool replicates_peers() const noexcept override { return false; }
  int lead_cycles() const noexcept override { return 0; }
  double longest_world_step_s() const noexcept override { return INFINITY; }
  ProxyDrive drive(const UserSpec&, const HapticReport& before, const HapticReport& now, double) const override {
    if (!settings_.device_force_in_world) return {};
    return {mean_wrench(before, now), std::nullopt, {}};
  }
  bool corrects_gradually() const noexcept override { return false; }
  Correction correction(const CopyPair& pair, const Indicators& indicators) const noexcept override {
    const double s = pair.peer ? 0.0 : pair.proxy ? 1.0 : blend_weight(indicators, settings_);
    return {.world = s, .sub = 1.0 - s};
  }

 private:
  PaperSettings settings_;
};

/// Impulses up, time-stamped states down, the outside as ghosts.
///
/// Up: the mean force F of the cycle acts on the world's proxy, and a linearly implicit spring draws it to where the
/// sub-world's proxy was at the same time; where the two agree, what acts is F. Down: a closed island is the
/// sub-world's; of any other difference a part a = min(1/2, 1.2 r / (r + q)) goes into the sub-world, q the extra delay
/// in haptic steps. A larger part would drag the sub-world ahead of itself under delay.
class Reduced final : public Scheme {
 public:
  explicit Reduced(const Settings&) {}
  std::string_view name() const noexcept override { return "reduced"; }
  Border border() const noexcept override { return Border::ghosts; }
  bool replicates_peers() const noexcept override { return true; }
  int lead_cycles() const noexcept override { return 1; }
  double longest_world_step_s() const noexcept override { return 0.005; }
  ProxyDrive drive(const UserSpec& user, const HapticReport& before, const HapticReport& now,
                   double until_s) const override {
    const BodyState proxy = between(before, now, until_s);
    return {mean_wrench(before, now),
            DevicePose{{proxy.position, proxy.orientation}, proxy.linear_velocity, proxy.angular_velocity},
            ForceLimits{INFINITY, INFINITY, user.device.degrees_of_freedom == 6}};
  }
  bool corrects_gradually() const noexcept override { return true; }
  Correction correction(const CopyPair& pair, const Indicators&) const noexcept override {
    if (pair.closed) return {.world = 1.0, .sub = 0.0};
    return {.world = 0.0, .sub = std::min(kLargestGain, kDelayGain / std::max(1.0, pair.lag_cycles))};
  }

 private:
  static constexpr double kLargestGain = 0.5;
  static constexpr double kDelayGain = 1.2;

  /// The proxy on its way between two reports; cubic in position. Beyond the newest, at constant velocity.
  static BodyState between(const HapticReport& before, const HapticReport& now, double t_s) noexcept {
    const double span = now.stamp_s - before.stamp_s;
    if (t_s >= now.stamp_s || span <= 0.0) return advanced(now.proxy, t_s - now.stamp_s);
    const double s = (t_s - before.stamp_s) / span;
    BodyState on_the_way = blend(before.proxy, now.proxy, s);
    on_the_way.position += s * (1.0 - s) *
                           ((1.0 - s) * (span * before.proxy.linear_velocity) - s * (span * now.proxy.linear_velocity) -
                            (1.0 - 2.0 * s) * (now.proxy.position - before.proxy.position));
    return on_the_way;
  }
};

template <class S>
std::unique_ptr<Scheme> make(const Settings& settings) {
  return std::make_unique<S>(settings);
}

struct Maker {
  std::string_view name;
  std::unique_ptr<Scheme> (*make)(const Settings&);
};

constexpr std::array kMakers{Maker{"direct", make<Direct>}, Maker{"paper", make<Paper>},
                             Maker{"reduced", make<Reduced>}};

}  // namespace

Wrench mean_wrench(const HapticReport& before, const HapticReport& now) noexcept {
  const double dt = now.stamp_s - before.stamp_s;
  if (dt <= 0.0) return {};
  return {(now.impulse_total.force - before.impulse_total.force) / dt,
          (now.impulse_total.torque - before.impulse_total.torque) / dt};
}

std::unique_ptr<Scheme> make_scheme(const Settings& settings) {
  std::string known;
  for (const Maker& maker : kMakers) {
    if (maker.name == settings.scheme) return maker.make(settings);
    known += fmt::format("{}{}", known.empty() ? "" : ", ", maker.name);
  }
  throw Error(ExitCode::usage, fmt::format("scheme \"{}\" is unknown; choose one of: {}", settings.scheme, known));
}

}  // namespace subworld
