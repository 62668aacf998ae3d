#include "lab/session/etvo.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

namespace subworld {

namespace {

constexpr double kSample_s = 1e-3;
constexpr double kBand_s = 0.3;
constexpr double kWarp = 0.01, kFelt = 0.01;

/// Every `stride`th sample.
std::vector<Vec3> sampled(std::span<const Vec3> force, std::size_t stride) {
  std::vector<Vec3> samples;
  for (std::size_t i = 0; i < force.size(); i += stride) samples.push_back(force[i]);
  return samples;
}

enum class Step : std::uint8_t { both, force, reference };  ///< which index rises

/// The best last step to each pair (1): a row for each i, with j from i - band to i + band.
std::vector<Step> last_steps(const std::vector<Vec3>& force, const std::vector<Vec3>& reference, std::size_t band,
                             double warp) {
  const std::size_t n = force.size(), width = 2 * band + 1;
  std::vector<Step> steps(n * width, Step::both);
  std::vector<double> before(width + 1, INFINITY), now(width + 1, INFINITY);
  before[band] = 0.0;  // of (-1, -1)
  for (std::size_t i = 0; i < n; ++i) {
    std::ranges::fill(now, INFINITY);
    for (std::size_t k = band - std::min(i, band); k < width && i + k < n + band; ++k) {
      double least = before[k];
      Step& step = steps[i * width + k];
      if (before[k + 1] + warp < least) {
        least = before[k + 1] + warp;
        step = Step::force;
      }
      if (k > 0 && now[k - 1] + warp < least) {
        least = now[k - 1] + warp;
        step = Step::reference;
      }
      now[k] = least + (force[i] - reference[i + k - band]).norm();
    }
    std::swap(before, now);
  }
  return steps;
}

double quantile(std::vector<double>& values, double part) {
  if (values.empty()) return NAN;
  const auto at = static_cast<std::ptrdiff_t>(part * static_cast<double>(values.size() - 1));
  std::ranges::nth_element(values, values.begin() + at);
  return values[static_cast<std::size_t>(at)];
}

}  // namespace

Etvo etvo(std::span<const Vec3> all, std::span<const Vec3> all_of_reference, double h_s) {
  const std::size_t common = std::min(all.size(), all_of_reference.size());
  const auto stride = static_cast<std::size_t>(std::max(1.0, std::round(kSample_s / h_s)));
  const std::vector<Vec3> force = sampled(all.first(common), stride);
  const std::vector<Vec3> reference = sampled(all_of_reference.first(common), stride);
  const double dt = h_s * static_cast<double>(stride);
  const auto band = static_cast<std::size_t>(std::ceil(kBand_s / dt));
  double largest = 0.0;
  for (const Vec3& r : reference) largest = std::max(largest, r.norm());
  const std::vector<Step> steps = last_steps(force, reference, band, kWarp * largest);
  std::vector<double> times_s, values_n;
  for (std::size_t i = force.size(), j = i; largest > 0.0 && i > 0 && j > 0;) {
    const Vec3 &f = force[i - 1], &r = reference[j - 1];
    if (std::max(f.norm(), r.norm()) >= kFelt * largest) {
      times_s.push_back(dt * std::abs(static_cast<double>(i) - static_cast<double>(j)));
      values_n.push_back((f - r).norm());
    }
    const Step step = steps[(i - 1) * (2 * band + 1) + j + band - i];
    if (step != Step::reference) --i;
    if (step != Step::force) --j;
  }
  return {quantile(times_s, 0.5), quantile(times_s, 0.99), quantile(values_n, 0.5), quantile(values_n, 0.99)};
}

}  // namespace subworld
