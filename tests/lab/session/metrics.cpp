#include "lab/session/metrics.hpp"

#include <algorithm>
#include <cmath>

namespace subworld {

namespace {

constexpr int kWindow = 41;         ///< samples
constexpr double kMostLag_s = 0.2;  ///< a larger lag does not count as a delay

struct Sums {
  double difference = 0.0;
  double reference = 0.0;
  [[nodiscard]] double ratio() const noexcept { return std::sqrt(difference / reference); }
};

/// RMS error of F against R, with F taken `lag` samples later.
double rms_at(std::span<const ForcePair> users, std::ptrdiff_t lag) noexcept {
  Sums sums;
  for (const auto& [force, reference] : users) {
    const auto n = static_cast<std::ptrdiff_t>(reference.size());
    for (std::ptrdiff_t i = std::max<std::ptrdiff_t>(0, -lag); i < std::min(n, n - lag); ++i) {
      sums.difference += (force[i + lag] - reference[i]).squaredNorm();
      sums.reference += reference[i].squaredNorm();
    }
  }
  return sums.ratio();
}

/// Sum of |F - mean|^2.
double roughness(std::span<const Vec3> force, std::span<const Vec3> mean) noexcept {
  double sum = 0.0;
  for (std::size_t i = 0; i < force.size(); ++i) sum += (force[i] - mean[i]).squaredNorm();
  return sum;
}

/// Sets `time_offset_s` and `value_offset`.
void find_offset(ForceError& error, std::span<const ForcePair> users, std::size_t shortest, double h_s) {
  const auto most = std::min(static_cast<std::ptrdiff_t>(kMostLag_s / h_s), static_cast<std::ptrdiff_t>(shortest / 2));
  std::ptrdiff_t best = 0;
  error.value_offset = error.rms;
  for (std::ptrdiff_t lag = -most; lag <= most; ++lag) {
    const double rms = rms_at(users, lag);
    if (rms < error.value_offset) {
      error.value_offset = rms;
      best = lag;
    }
  }
  // The square of the RMS is smooth in the lag: a parabola through three points gives the minimum between samples.
  double fraction = 0.0;
  if (std::abs(best) < most) {
    const double left = std::pow(rms_at(users, best - 1), 2);
    const double middle = std::pow(error.value_offset, 2);
    const double right = std::pow(rms_at(users, best + 1), 2);
    const double bend = left - 2.0 * middle + right;
    if (bend > 0.0) fraction = std::clamp(0.5 * (left - right) / bend, -0.5, 0.5);
  }
  error.time_offset_s = (static_cast<double>(best) + fraction) * h_s;
}

/// Sets `jitter_ratio` and `smoothed_rms`.
void compare_smoothed(ForceError& error, std::span<const ForcePair> users) {
  std::vector<std::vector<Vec3>> means;
  means.reserve(2 * users.size());
  std::vector<ForcePair> smooth;
  Sums noise;
  for (const auto& [force, reference] : users) {
    const std::vector<Vec3>& mean = means.emplace_back(smoothed(force, kWindow));
    const std::vector<Vec3>& reference_mean = means.emplace_back(smoothed(reference, kWindow));
    noise.difference += roughness(force, mean);
    noise.reference += roughness(reference, reference_mean);
    smooth.push_back({mean, reference_mean});
  }
  error.jitter_ratio = noise.ratio();
  error.smoothed_rms = rms_at(smooth, 0);
}

}  // namespace

std::vector<Vec3> smoothed(std::span<const Vec3> force, int window) {
  std::vector<Vec3> means(force.size());
  const int half = window / 2;
  const int n = static_cast<int>(force.size());
  for (int i = 0; i < n; ++i) {
    const int first = std::max(0, i - half);
    const int last = std::min(n - 1, i + half);
    Vec3 sum = Vec3::Zero();
    for (int k = first; k <= last; ++k) sum += force[k];
    means[i] = sum / (last - first + 1);
  }
  return means;
}

double noise_n(std::span<const Vec3> force) {
  return std::sqrt(roughness(force, smoothed(force, kWindow)) / static_cast<double>(force.size()));
}

ForceError force_error(std::span<const ForcePair> all, double h_s) {
  ForceError error;
  std::vector<ForcePair> users;
  std::vector<double> distances;
  double largest = 0.0;
  std::size_t shortest = all.empty() ? 0 : all.front().force.size();
  for (const auto& [force, reference] : all) {
    const std::size_t n = std::min(force.size(), reference.size());
    users.push_back({force.first(n), reference.first(n)});
    shortest = std::min(shortest, n);
    for (std::size_t i = 0; i < n; ++i) {
      distances.push_back((force[i] - reference[i]).norm());
      largest = std::max(largest, reference[i].norm());
    }
  }
  if (distances.empty()) return error;
  error.rms = rms_at(users, 0);
  error.max = *std::ranges::max_element(distances) / largest;
  const std::size_t n = distances.size();
  const std::size_t at = std::min(n - 1, static_cast<std::size_t>(0.99 * static_cast<double>(n)));
  std::ranges::nth_element(distances, distances.begin() + static_cast<std::ptrdiff_t>(at));
  error.p99 = distances[at] / largest;
  find_offset(error, users, shortest, h_s);
  compare_smoothed(error, users);
  return error;
}

ForceError force_error(std::span<const Vec3> force, std::span<const Vec3> reference, double h_s) {
  const ForcePair user{force, reference};
  return force_error(std::span(&user, 1), h_s);
}

}  // namespace subworld
