#include "link_check/validate.hpp"

#include "link_check/probe.hpp"
#include "link_check/statistics.hpp"
#include "rt/cyclic.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

namespace subworld {

namespace {

constexpr double kMostProbes_hz = 1000.0;
constexpr double kProbesOfTheLink = 0.5;  ///< share of its rate and of its queue: delays on a full link say nothing
constexpr int kLoadBytes = 1400;
constexpr double kLoad_bit_s = 1e8;
constexpr double kRateTolerance = 0.02;
constexpr std::uint64_t kLeastBursts = 10;

LinkCheck around(const std::string& quantity, double requested, double measured, double allowed,
                 const std::string& unit) {
  return {quantity, requested, measured, std::max(0.0, requested - allowed), requested + allowed, unit};
}

double delay_tolerance_s(double requested_s) { return std::max(kDelayTolerance_s, kDelayTolerance * requested_s); }

/// A delay that `q` of the packets do not exceed; the rank of a sample's quantile is itself uncertain.
LinkCheck quantile_check(const std::string& name, double q, const LinkStatistics& expected,
                         const LinkStatistics& measured) {
  const double n = std::max<double>(1.0, static_cast<double>(measured.received));
  const double rank = kStandardErrors * std::sqrt(q * (1.0 - q) / n);
  const double low = expected.quantile_s(q - rank), high = expected.quantile_s(q + rank);
  return {name,
          1e3 * expected.quantile_s(q),
          1e3 * measured.quantile_s(q),
          1e3 * std::max(0.0, low - delay_tolerance_s(low)),
          1e3 * (high + delay_tolerance_s(high)),
          "ms"};
}

void judge_delay(const LinkSettings& settings, const LinkStatistics& expected, const LinkStatistics& measured,
                 std::vector<LinkCheck>& checks) {
  const double n = std::max<double>(1.0, static_cast<double>(measured.received));
  const double deviation = expected.delay_deviation_s;
  // Behind a rate, delays in a row are alike: fewer independent samples.
  const double errors = kStandardErrors * (settings.rate_bit_s > 0.0 ? 3.0 : 1.0);
  const double mean_error = errors * deviation / std::sqrt(n);
  const double spread = std::max(0.0, expected.delay_fourth_moment_s4 - std::pow(deviation, 4.0));
  const double deviation_error = deviation > 0.0 ? errors * std::sqrt(spread / n) / (2.0 * deviation) : 0.0;
  checks.push_back(around("delay mean", 1e3 * expected.delay_mean_s, 1e3 * measured.delay_mean_s,
                          1e3 * (delay_tolerance_s(expected.delay_mean_s) + mean_error), "ms"));
  checks.push_back(around("jitter (std. dev.)", 1e3 * deviation, 1e3 * measured.delay_deviation_s,
                          1e3 * (delay_tolerance_s(deviation) + deviation_error), "ms"));
  checks.push_back(quantile_check("delay p1", 0.01, expected, measured));
  checks.push_back(quantile_check("delay p50", 0.5, expected, measured));
  checks.push_back(quantile_check("delay p99", 0.99, expected, measured));
}

void judge_loss(const LinkSettings& settings, const LinkStatistics& expected, const LinkStatistics& measured,
                std::vector<LinkCheck>& checks) {
  const double n = static_cast<double>(measured.sent);
  // A duplicated packet that is lost is delivered once.
  const double arrives_twice = 1.0 - settings.duplicate_ratio;
  const double loss = settings.loss.loss_ratio() * arrives_twice;
  const double error = kStandardErrors * std::max(loss_deviation(settings.loss, n), std::sqrt(loss * (1.0 - loss) / n));
  checks.push_back(around("loss", 100.0 * loss, 100.0 * measured.loss_ratio(), 100.0 * error, "%"));
  if (std::abs(expected.loss_ratio() - loss) > 0.005 + error)
    checks.back().note = "not judged: the probes alone overfill the link";
  if (loss > 0.0) {
    const double burst = expected.burst_mean();
    const double bursts = std::max<double>(1.0, static_cast<double>(measured.bursts));
    const double burst_error = kStandardErrors * std::sqrt(std::max(0.0, burst * (burst - 1.0)) / bursts) + 0.02;
    checks.push_back(around("lost in a row, mean", burst, measured.burst_mean(), burst_error, ""));
    if (measured.bursts < kLeastBursts) checks.back().note = "not judged: too few losses";
  }
  const double duplicates = settings.duplicate_ratio * (1.0 - settings.loss.loss_ratio());
  checks.push_back(around("duplicates", 100.0 * duplicates, 100.0 * measured.duplicate_ratio(),
                          100.0 * kStandardErrors * std::sqrt(duplicates * (1.0 - duplicates) / n), "%"));
}

void judge_order(const LinkStatistics& expected, const LinkStatistics& measured, std::vector<LinkCheck>& checks) {
  const double n = std::max<double>(1.0, static_cast<double>(measured.received));
  const double ratio = expected.reorder_ratio();
  // Packets that one late packet lets pass are counted together: 1.5 errors.
  const double error = ratio > 0.0 ? 1.5 * kStandardErrors * std::sqrt(ratio * (1.0 - ratio) / n) + 0.002 : 0.0;
  checks.push_back(around("out of order", 100.0 * ratio, 100.0 * measured.reorder_ratio(), 100.0 * error, "%"));
}

/// Sends 1.3 times the rate for about a second: the receiver then gets the rate.
LinkCheck rate_check(EmulatedNetwork& network, LinkEnds ends, const LinkSettings& settings) {
  const double rate = settings.rate_bit_s;
  LinkCheck check = around("rate", 1e-6 * rate, 0.0, 1e-6 * rate * kRateTolerance, "Mbit/s");
  if (rate > kLoad_bit_s) {
    check.note = "not measured above 100 Mbit/s";
    return check;
  }
  const int bytes = static_cast<int>(std::clamp(rate / 8.0 / 500.0, 64.0, 1400.0));
  const double rate_hz = 1.3 * rate / (8.0 * bytes);
  // At least 200 packets, and no more than half of what the queue takes.
  const double duration_s = std::max(1.0, 200.0 / rate_hz);
  const double rest_s = settings.delay_s + 4.0 * settings.jitter_s + 0.4 * duration_s + 0.2;
  const auto probed = probe(network, {{ends, rate_hz, duration_s, bytes}}, rest_s);
  const double span_s = probed[0].last_s - probed[0].first_s;
  const double count = static_cast<double>(probed[0].arrivals.size());
  if (span_s > 0.0) check.measured = 1e-6 * 8.0 * bytes * (count - 1.0) / span_s;
  if (settings.loss.loss_ratio() > 0.2) check.note = "not judged: the losses leave too few packets";
  return check;
}

/// 100 Mbit/s for a second: what arrives but for the requested losses, and the CPU time of the forwarder.
std::vector<LinkCheck> load_checks(EmulatedNetwork& network, LinkEnds ends, const LinkSettings& settings) {
  const double rate_hz = kLoad_bit_s / (8.0 * kLoadBytes);
  if ((settings.rate_bit_s > 0.0 && settings.rate_bit_s < 1.1 * kLoad_bit_s) ||
      rate_hz * (settings.delay_s + settings.jitter_s + 0.01) > settings.limit)
    return {};
  const double used_s = network.cpu_s();
  const LinkCounters before = network.counters(ends);
  const auto probed =
      probe(network, {{ends, rate_hz, 1.0, kLoadBytes}}, settings.delay_s + 4.0 * settings.jitter_s + 0.1);
  const LinkStatistics measured = statistics_of(probed[0].arrivals, probed[0].sent);
  const LinkCounters after = network.counters(ends);
  const double n = static_cast<double>(measured.sent);
  const double loss = settings.loss.loss_ratio() * (1.0 - settings.duplicate_ratio);
  const double error = kStandardErrors * loss_deviation(settings.loss, n) + 0.002;
  std::vector<LinkCheck> checks;
  checks.push_back(around("100 Mbit/s: loss", 100.0 * loss, 100.0 * measured.loss_ratio(), 100.0 * error, "%"));
  checks.push_back(
      {"100 Mbit/s: full queue", 0.0, static_cast<double>(after.queue_full - before.queue_full), 0.0, 0.0, ""});
  checks.push_back({"100 Mbit/s: CPU", 0.0, 100.0 * (network.cpu_s() - used_s), 0.0, 100.0, "% of core"});
  return checks;
}

}  // namespace

double probe_rate_hz(const LinkSettings& settings) noexcept {
  const double on_their_way_s = std::max(1e-3, settings.delay_s + 4.0 * settings.jitter_s);
  double rate_hz = std::min(kMostProbes_hz, kProbesOfTheLink * settings.limit / on_their_way_s);
  if (settings.rate_bit_s > 0.0)
    rate_hz = std::min(rate_hz, kProbesOfTheLink * settings.rate_bit_s / (8.0 * kProbeBytes));
  return rate_hz;
}

bool LinkValidation::ok() const noexcept {
  return std::ranges::all_of(checks, [](const LinkCheck& check) { return check.ok(); });
}

std::vector<LinkCheck> judge(const LinkSettings& settings, const LinkStatistics& measured, double period_s, int bytes) {
  constexpr std::uint64_t kLeast = 500'000;
  const LinkStatistics expected =
      expected_statistics(settings, std::max<std::uint64_t>(kLeast, 10 * measured.sent), period_s, bytes);
  std::vector<LinkCheck> checks;
  judge_delay(settings, expected, measured, checks);
  judge_loss(settings, expected, measured, checks);
  judge_order(expected, measured, checks);
  return checks;
}

std::vector<LinkValidation> validate(EmulatedNetwork& network, double duration_s) {
  const std::vector<LinkEnds> both{{0, 1}, {1, 0}};
  std::vector<ProbePlan> plans;
  double rest_s = 0.2;
  for (const LinkEnds ends : both) {
    const LinkSettings settings = network.link(ends);
    plans.push_back({ends, probe_rate_hz(settings), duration_s, kProbeBytes});
    const double queue_s = settings.rate_bit_s > 0.0 ? 8.0 * kProbeBytes * settings.limit / settings.rate_bit_s : 0.0;
    rest_s = std::max(rest_s, 0.2 + settings.delay_s + 4.0 * settings.jitter_s + std::min(queue_s, duration_s));
  }
  const auto probed = probe(network, plans, rest_s);
  std::vector<LinkValidation> found;
  for (std::size_t i = 0; i < both.size(); ++i) {
    const LinkSettings settings = network.link(both[i]);
    found.push_back({both[i], judge(settings, statistics_of(probed[i].arrivals, probed[i].sent), 1.0 / plans[i].rate_hz,
                                    kProbeBytes)});
    if (settings.rate_bit_s > 0.0) found.back().checks.push_back(rate_check(network, both[i], settings));
  }
  for (LinkCheck& check : load_checks(network, both[0], network.link(both[0]))) found[0].checks.push_back(check);
  return found;
}

std::string table_of(const std::vector<LinkCheck>& checks) {
  std::string text = fmt::format("  {:<24}{:>12}{:>12}  {:<12}{:<24}{}\n", "quantity", "requested", "measured", "unit",
                                 "allowed", "verdict");
  for (const LinkCheck& check : checks) {
    text += fmt::format("  {:<24}{:>12.3f}{:>12.3f}  {:<12}{:<24}{}\n", check.quantity, check.requested, check.measured,
                        check.unit, fmt::format("{:.3f} to {:.3f}", check.least, check.most),
                        !check.note.empty() ? check.note
                        : check.ok()        ? "ok"
                                            : "MISSED");
  }
  return text;
}

}  // namespace subworld
