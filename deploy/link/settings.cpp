#include "link/settings.hpp"

#include <fmt/core.h>

#include <array>
#include <cmath>
#include <limits>

namespace subworld {

namespace {

constexpr std::array kLinkPresets{
    LinkPreset{"ideal", "delay 0ms", "no delay and no loss"},
    LinkPreset{"lan", "delay 0.1ms rate 1gbit", "a switch in the same building"},
    LinkPreset{"wifi", "delay 15ms 10ms loss 8%", "Wi-Fi behind concrete"},
    LinkPreset{"4g", "delay 50ms 15ms loss 3%", "a mobile network"},
    LinkPreset{"starlink", "delay 30ms 10ms loss 2%", "satellites in a low orbit"},
    LinkPreset{"hotel", "delay 40ms 20ms loss 2%", "the shared Wi-Fi of a hotel"},
    LinkPreset{"transatlantic", "delay 45ms", "a leased line across the Atlantic"},
};

constexpr std::array kShapeNames{"uniform", "normal", "pareto"};

std::string time_text(double s) { return fmt::format("{}ms", std::round(s * 1e9) / 1e6); }
std::string ratio_text(double ratio) { return fmt::format("{}%", std::round(ratio * 1e12) / 1e10); }

}  // namespace

double LossModel::loss_ratio() const noexcept {
  const double bad = bad_ratio();
  return bad * loss_in_bad + (1.0 - bad) * loss_in_good;
}

double LossModel::burst_mean() const noexcept {
  const double bad = bad_ratio();
  const double lost = loss_ratio();
  if (lost <= 0.0) return 0.0;
  // Probability that a packet and the one after it are lost.
  const double after_bad = r * loss_in_good + (1.0 - r) * loss_in_bad;
  const double after_good = p * loss_in_bad + (1.0 - p) * loss_in_good;
  const double both = bad * loss_in_bad * after_bad + (1.0 - bad) * loss_in_good * after_good;
  const double begins = lost - both;
  return begins <= 0.0 ? std::numeric_limits<double>::infinity() : lost / begins;
}

double LossModel::deviation(double packets) const noexcept {
  const double lost = loss_ratio(), bad = bad_ratio();
  const double memory = 1.0 - p - r;  // correlation of the states of two packets in a row
  const double step = loss_in_bad - loss_in_good;
  const double correlated =
      p > 0.0 && memory < 1.0 ? 2.0 * step * step * bad * (1.0 - bad) * memory / (1.0 - memory) : 0;
  return packets > 0.0 ? std::sqrt(std::fmax(0.0, lost * (1.0 - lost) + correlated) / packets) : 0.0;
}

bool Outage::holds(double t_s) const noexcept {
  if (for_s <= 0.0 || t_s < from_s) return false;
  const double since_s = t_s - from_s;
  return (every_s > 0.0 ? std::fmod(since_s, every_s) : since_s) < for_s;
}

std::span<const LinkPreset> link_presets() noexcept { return kLinkPresets; }

std::string to_text(const LinkSettings& settings) {
  const LinkSettings ideal;
  std::string text;
  const auto add = [&](const std::string& words) { text += (text.empty() ? "" : " ") + words; };
  if (settings.delay_s > 0.0 || settings.jitter_s > 0.0) add("delay " + time_text(settings.delay_s));
  if (settings.jitter_s > 0.0) add(time_text(settings.jitter_s));
  if (settings.shape != ideal.shape)
    add(fmt::format("distribution {}", kShapeNames[static_cast<std::size_t>(settings.shape)]));
  const LossModel& loss = settings.loss;
  if (loss.p > 0.0) {
    add(fmt::format("loss gemodel {} {} {} {}", ratio_text(loss.p), ratio_text(loss.r), ratio_text(loss.loss_in_bad),
                    ratio_text(loss.loss_in_good)));
  } else if (loss.loss_in_good > 0.0) {
    add("loss " + ratio_text(loss.loss_in_good));
  }
  if (settings.duplicate_ratio > 0.0) add("duplicate " + ratio_text(settings.duplicate_ratio));
  if (settings.reorder_ratio > 0.0) add("reorder " + ratio_text(settings.reorder_ratio));
  if (settings.reorder_ratio > 0.0 && settings.reorder_gap != 1) add(fmt::format("gap {}", settings.reorder_gap));
  if (settings.rate_bit_s > 0.0) add(fmt::format("rate {}kbit", settings.rate_bit_s / 1e3));
  if (settings.limit != ideal.limit) add(fmt::format("limit {}", settings.limit));
  const Outage& outage = settings.outage;
  if (outage.for_s > 0.0) {
    add(fmt::format("outage from {} for {}", time_text(outage.from_s), time_text(outage.for_s)));
    if (outage.every_s > 0.0) add("every " + time_text(outage.every_s));
  }
  return text.empty() ? "ideal" : text;
}

}  // namespace subworld
