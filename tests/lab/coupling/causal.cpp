#include "lab/coupling/causal.hpp"

#include "coupling/messages/delay.hpp"
#include "haptic_sim/peer_forecast.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace subworld {

namespace {

constexpr double kSame = 1e-9;  ///< m, m/s, N

enum class Forecast { constant_velocity, as_the_product };

using Course = std::vector<DeviceState>;  ///< of a device, by haptic step

/// (1)
Course continued(const Course& exact, DelayLine<DeviceState> line, Forecast forecast) {
  Course motion = exact;
  PeerForecast observer;
  for (std::size_t step = 0; step < exact.size(); ++step) {
    const DeviceState& heard = line.pass(exact[step], step);
    DevicePose device{heard.pose, heard.linear_velocity, heard.angular_velocity};
    observer.observe(heard);
    const double ahead_s = std::min(exact[step].stamp_s - heard.stamp_s, kLongestGuess_s);
    if (forecast == Forecast::as_the_product && ahead_s > 0.0) {
      observer.advance(device, ahead_s, 1.0);
    } else {
      device.pose.position += ahead_s * device.linear_velocity;
      device.pose.orientation = rotated(device.pose.orientation, device.angular_velocity, ahead_s);
    }
    motion[step].pose = device.pose;
    motion[step].linear_velocity = device.linear_velocity;
    motion[step].angular_velocity = device.angular_velocity;
    motion[step].applied = heard.applied;
  }
  return motion;
}

bool same(const Course& a, const Course& b) {
  return std::ranges::equal(a, b, [](const DeviceState& x, const DeviceState& y) {
    return (x.pose.position - y.pose.position).norm() < kSame &&
           x.pose.orientation.angularDistance(y.pose.orientation) < kSame &&
           (x.linear_velocity - y.linear_velocity).norm() < kSame &&
           (x.angular_velocity - y.angular_velocity).norm() < kSame &&
           (x.applied.force - y.applied.force).norm() < kSame && (x.applied.torque - y.applied.torque).norm() < kSame;
  });
}

/// The motion of all devices, as user u can know it. That of u itself is left empty.
std::vector<Course> known_to(std::size_t u, const Scene& scene, const DelaySettings& delay, const Outcome& reference,
                             Forecast forecast) {
  Settings late = scene.settings;
  late.delay = delay;
  std::vector<Course> known(reference.felt.size());
  for (std::size_t p = 0; p < known.size(); ++p) {
    if (p == u) continue;
    const auto link = static_cast<std::uint32_t>(u * known.size() + p);
    known[p] = continued(reference.felt[p].device, {late, Direction::from_peer, link}, forecast);
  }
  return known;
}

/// The force that u feels where it knows the others so; empty if a signal requested a stop.
std::optional<FeltHistory> felt_with(std::size_t u, const Scene& scene, const std::vector<Course>& known) {
  std::optional<Outcome> run = run_out(scene, [&](CoupledRun& ideal) {
    for (std::size_t p = 0; p < known.size(); ++p) ideal.replay(p, known[p]);
  });
  if (!run) return std::nullopt;
  return std::move(run->felt[u]);
}

}  // namespace

std::optional<CausalErrors> causal_errors_of(const Scene& scene, const DelaySettings& delay, const Outcome& reference) {
  const std::size_t users = reference.felt.size();
  const double h_s = scene.settings.h_s;
  CausalErrors errors{.all = 0.0, .by_user = std::vector<double>(users, 0.0)};
  if (users < 2 || !delay.any()) return errors;
  std::vector<FeltHistory> ideal(users);
  for (std::size_t u = 0; u < users; ++u) {
    std::vector<Course> before;
    for (std::size_t p = 0; p < users; ++p) before.push_back(p == u ? Course{} : reference.felt[p].device);
    ideal[u].force = reference.felt[u].force;
    double least = NAN;
    for (const Forecast forecast : {Forecast::as_the_product, Forecast::constant_velocity}) {
      std::vector<Course> known = known_to(u, scene, delay, reference, forecast);
      if (std::ranges::equal(known, before, same)) break;
      std::optional<FeltHistory> felt = felt_with(u, scene, known);
      if (!felt) return std::nullopt;
      const double error = force_error(felt->force, reference.felt[u].force, h_s).rms;
      if (std::isnan(least) || error < least) {
        least = errors.by_user[u] = error;
        ideal[u].force = std::move(felt->force);
      }
      before = std::move(known);
    }
  }
  errors.all = force_error(ideal, reference.felt, h_s).rms;
  return errors;
}

}  // namespace subworld
