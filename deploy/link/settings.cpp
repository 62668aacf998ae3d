#include "link/settings.hpp"

#include "model/error.hpp"
#include "model/joined.hpp"
#include "model/shapes/nearest.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <sstream>
#include <string_view>
#include <vector>

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

const LinkPreset* preset_of(std::string_view word) {
  const auto found =
      std::ranges::find(kLinkPresets, word, [](const LinkPreset& one) { return std::string_view(one.name); });
  return found == kLinkPresets.end() ? nullptr : &*found;
}

constexpr std::array kShapeNames{"uniform", "normal", "pareto"};

struct Unit {
  std::string_view name;
  double factor;
};
constexpr std::array kTimes{Unit{"s", 1.0}, Unit{"ms", 1e-3}, Unit{"us", 1e-6}, Unit{"ns", 1e-9}};
constexpr std::array kRates{Unit{"bit", 1.0}, Unit{"kbit", 1e3}, Unit{"mbit", 1e6}, Unit{"gbit", 1e9}};
constexpr std::array kRatios{Unit{"%", 0.01}};

constexpr double kLongest_s = 3600.0;
constexpr double kLongestDelay_s = 60.0;

/// A kind of quantity: its units, its limits, and an example for messages.
struct Quantity {
  std::span<const Unit> units;
  double least, most;
  const char* limits;
  const char* example;
};
const Quantity kDelay{kTimes, 0.0, kLongestDelay_s, "0 to 60 s", "20ms"};
const Quantity kInstant{kTimes, 0.0, kLongest_s, "0 to 3600 s", "2s"};
const Quantity kRatio{kRatios, 0.0, 1.0, "0 to 100 %", "2%"};
const Quantity kRate{kRates, 1e3, 1e11, "1 kbit/s to 100 Gbit/s", "10mbit"};

[[noreturn]] void refuse_link(const std::string& option, const std::string& what) {
  throw Error(ExitCode::usage, fmt::format("link: {}: {}", option, what));
}

/// The value of a word like `20ms` in units of the quantity; empty where the word is none.
std::optional<double> value_in(const std::string& word, const Quantity& quantity) {
  double number = 0.0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), number);
  if (error != std::errc{} || !std::isfinite(number)) return {};
  const std::string_view unit(end, static_cast<std::size_t>(word.data() + word.size() - end));
  if (unit.empty() && number == 0.0) return 0.0;
  for (const Unit& one : quantity.units) {
    if (unit == one.name) return number * one.factor;
  }
  return {};
}

/// Reads the words of a text one by one.
class LinkWords {
 public:
  explicit LinkWords(const std::string& text) {
    std::istringstream stream(text);
    for (std::string word; stream >> word;) words_.push_back(word);
  }

  [[nodiscard]] bool done() const { return at_ == words_.size(); }
  std::string next() { return words_[at_++]; }
  /// Takes the next word where it is this one.
  bool take(std::string_view word) {
    if (done() || words_[at_] != word) return false;
    ++at_;
    return true;
  }
  /// Takes the next word as a value where it begins like a number. Throws where it is a wrong one.
  std::optional<double> optional(const std::string& option, const Quantity& quantity) {
    if (done() || words_[at_].find_first_of("0123456789.+-") != 0 || preset_of(words_[at_]) != nullptr) return {};
    return value(option, quantity);
  }
  double value(const std::string& option, const Quantity& quantity) {
    if (done()) refuse_link(option, fmt::format("its value is missing; for example {}", example(option, quantity)));
    const std::string word = next();
    const auto found = value_in(word, quantity);
    if (!found) {
      std::vector<std::string_view> names;
      for (const Unit& unit : quantity.units) names.push_back(unit.name);
      refuse_link(option, fmt::format("\"{}\" must be a number with its unit ({}), for example {}", word,
                                      joined(names, ", "), example(option, quantity)));
    }
    if (*found < quantity.least || *found > quantity.most)
      refuse_link(option, fmt::format("{} is out of range {}", word, quantity.limits));
    return *found;
  }
  int whole(const std::string& option, int least, int most) {
    const std::string word = done() ? "" : next();
    int number = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), number);
    if (error != std::errc{} || end != word.data() + word.size() || number < least || number > most)
      refuse_link(option, fmt::format("\"{}\" must be a whole number of {} to {}", word, least, most));
    return number;
  }

 private:
  static std::string example(const std::string& option, const Quantity& quantity) {
    return fmt::format("`{} {}`", option, quantity.example);
  }
  std::vector<std::string> words_;
  std::size_t at_ = 0;
};

void read_delay(LinkWords& words, LinkSettings& link) {
  link.delay_s = words.value("delay", kDelay);
  link.jitter_s = words.optional("delay", kDelay).value_or(0.0);
  if (words.optional("delay", kRatio))
    refuse_link("delay", "a correlation is not supported; use `loss gemodel` for bursts");
}

void read_distribution(LinkWords& words, LinkSettings& link) {
  const std::string name = words.done() ? "" : words.next();
  const auto found = std::ranges::find(kShapeNames, name);
  if (found == kShapeNames.end())
    refuse_link("distribution", fmt::format("\"{}\" is none; choose one of: {}", name, joined(kShapeNames, ", ")));
  link.shape = static_cast<JitterShape>(found - kShapeNames.begin());
}

void read_loss(LinkWords& words, LinkSettings& link) {
  LossModel loss;
  if (words.take("gemodel")) {
    loss.p = words.value("loss gemodel", kRatio);
    loss.r = words.optional("loss gemodel", kRatio).value_or(1.0 - loss.p);
    loss.loss_in_bad = words.optional("loss gemodel", kRatio).value_or(1.0);
    loss.loss_in_good = words.optional("loss gemodel", kRatio).value_or(0.0);
    if (loss.p > 0.0 && loss.r <= 0.0)
      refuse_link("loss gemodel", "with r = 0 % the link never recovers; give the second value, for example `25%`");
  } else {
    words.take("random");
    loss.loss_in_good = words.value("loss", kRatio);
    if (words.optional("loss", kRatio))
      refuse_link("loss", "a correlation is not supported; use `loss gemodel P R` for bursts of losses");
  }
  link.loss = loss;
}

void read_outage(LinkWords& words, LinkSettings& link) {
  Outage outage;
  if (words.take("from")) outage.from_s = words.value("outage from", kInstant);
  if (!words.take("for")) refuse_link("outage", "its length is missing; for example `outage from 5s for 1s`");
  outage.for_s = words.value("outage for", kInstant);
  if (words.take("every")) outage.every_s = words.value("outage every", kInstant);
  if (outage.every_s > 0.0 && outage.every_s <= outage.for_s)
    refuse_link("outage", "`every` must be longer than `for`: the link would never be up");
  link.outage = outage;
}

struct LinkWord {
  std::string_view name;
  void (*read)(LinkWords&, LinkSettings&);
};
constexpr std::array kLinkWords{
    LinkWord{"delay", read_delay},
    LinkWord{"jitter", [](LinkWords& words, LinkSettings& link) { link.jitter_s = words.value("jitter", kDelay); }},
    LinkWord{"distribution", read_distribution},
    LinkWord{"loss", read_loss},
    LinkWord{"rate", [](LinkWords& words, LinkSettings& link) { link.rate_bit_s = words.value("rate", kRate); }},
    LinkWord{"duplicate",
             [](LinkWords& words, LinkSettings& link) { link.duplicate_ratio = words.value("duplicate", kRatio); }},
    LinkWord{"reorder",
             [](LinkWords& words, LinkSettings& link) {
               link.reorder_ratio = words.value("reorder", kRatio);
               link.reorder_gap = words.take("gap") ? words.whole("reorder gap", 1, 1'000'000) : 1;
             }},
    LinkWord{"limit", [](LinkWords& words, LinkSettings& link) { link.limit = words.whole("limit", 1, 100'000); }},
    LinkWord{"outage", read_outage},
};

void read_words(const std::string& text, LinkSettings& link) {
  for (LinkWords words(text); !words.done();) {
    const std::string word = words.next();
    if (const auto known = std::ranges::find(kLinkWords, word, &LinkWord::name); known != kLinkWords.end()) {
      known->read(words, link);
    } else if (const LinkPreset* preset = preset_of(word)) {
      link = LinkSettings{};
      read_words(preset->text, link);
    } else {
      std::vector<std::string_view> presets, options;
      for (const LinkPreset& one : kLinkPresets) presets.emplace_back(one.name);
      for (const LinkWord& one : kLinkWords) options.push_back(one.name);
      std::vector<std::string_view> all = presets;
      all.insert(all.end(), options.begin(), options.end());
      const std::string_view near = nearest(word, all);
      throw Error(ExitCode::usage,
                  fmt::format("link: \"{}\" is neither a preset ({}) nor an option ({}){}", word, joined(presets, ", "),
                              joined(options, ", "), near.empty() ? "" : fmt::format("; did you mean {}?", near)));
    }
  }
}

std::string time_text(double s) { return fmt::format("{}ms", std::round(s * 1e9) / 1e6); }
std::string ratio_text(double ratio) { return fmt::format("{}%", std::round(ratio * 1e12) / 1e10); }

}  // namespace

bool Outage::holds(double t_s) const noexcept {
  if (for_s <= 0.0 || t_s < from_s) return false;
  const double since_s = t_s - from_s;
  return (every_s > 0.0 ? std::fmod(since_s, every_s) : since_s) < for_s;
}

std::span<const LinkPreset> link_presets() noexcept { return kLinkPresets; }

LinkSettings parse_link(const std::string& text) {
  LinkSettings link;
  read_words(text, link);
  if (link.reorder_ratio > 0.0 && link.delay_s <= 0.0)
    refuse_link("reorder",
                "needs a delay: a packet overtakes those that are delayed; for example `delay 10ms reorder 5%`");
  return link;
}

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
