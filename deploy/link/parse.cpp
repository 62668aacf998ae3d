#include "link/settings.hpp"
#include "model/error.hpp"
#include "model/joined.hpp"
#include "model/nearest.hpp"

#include <fmt/core.h>

#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <sstream>
#include <string_view>
#include <vector>

namespace subworld {

namespace {

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
    if (done() || words_[at_].find_first_of("0123456789.+-") != 0 || is_preset(words_[at_])) return {};
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
  static bool is_preset(std::string_view word) {
    for (const LinkPreset& preset : link_presets()) {
      if (word == preset.name) return true;
    }
    return false;
  }
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

void read_jitter(LinkWords& words, LinkSettings& link) { link.jitter_s = words.value("jitter", kDelay); }

void read_distribution(LinkWords& words, LinkSettings& link) {
  constexpr std::array kShapes{"uniform", "normal", "pareto"};
  const std::string name = words.done() ? "" : words.next();
  for (std::size_t i = 0; i < kShapes.size(); ++i) {
    if (name == kShapes[i]) return void(link.shape = static_cast<JitterShape>(i));
  }
  refuse_link("distribution", fmt::format("\"{}\" is none; choose one of: {}", name, joined(kShapes, ", ")));
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

void read_duplicate(LinkWords& words, LinkSettings& link) { link.duplicate_ratio = words.value("duplicate", kRatio); }

void read_reorder(LinkWords& words, LinkSettings& link) {
  link.reorder_ratio = words.value("reorder", kRatio);
  link.reorder_gap = words.take("gap") ? words.whole("reorder gap", 1, 1'000'000) : 1;
}

void read_rate(LinkWords& words, LinkSettings& link) { link.rate_bit_s = words.value("rate", kRate); }

void read_limit(LinkWords& words, LinkSettings& link) { link.limit = words.whole("limit", 1, 100'000); }

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
    LinkWord{"delay", read_delay},     LinkWord{"jitter", read_jitter}, LinkWord{"distribution", read_distribution},
    LinkWord{"loss", read_loss},       LinkWord{"rate", read_rate},     LinkWord{"duplicate", read_duplicate},
    LinkWord{"reorder", read_reorder}, LinkWord{"limit", read_limit},   LinkWord{"outage", read_outage},
};

void read_words(LinkWords& words, LinkSettings& link);

bool read_word(const std::string& word, LinkWords& words, LinkSettings& link) {
  for (const LinkWord& known : kLinkWords) {
    if (word == known.name) return known.read(words, link), true;
  }
  for (const LinkPreset& preset : link_presets()) {
    if (word != preset.name) continue;
    link = LinkSettings{};
    LinkWords inner(preset.text);
    read_words(inner, link);
    return true;
  }
  return false;
}

void read_words(LinkWords& words, LinkSettings& link) {
  while (!words.done()) {
    const std::string word = words.next();
    if (read_word(word, words, link)) continue;
    std::vector<std::string_view> presets, all;
    for (const LinkPreset& preset : link_presets()) presets.emplace_back(preset.name);
    all = presets;
    for (const LinkWord& known : kLinkWords) all.push_back(known.name);
    const std::string_view near = nearest(word, all);
    std::vector<std::string_view> options;
    for (const LinkWord& known : kLinkWords) options.push_back(known.name);
    throw Error(ExitCode::usage,
                fmt::format("link: \"{}\" is neither a preset ({}) nor an option ({}){}", word, joined(presets, ", "),
                            joined(options, ", "), near.empty() ? "" : fmt::format("; did you mean {}?", near)));
  }
}

}  // namespace

LinkSettings parse_link(const std::string& text) {
  LinkSettings link;
  LinkWords words(text);
  read_words(words, link);
  if (link.reorder_ratio > 0.0 && link.delay_s <= 0.0)
    refuse_link("reorder",
                "needs a delay: a packet overtakes those that are delayed; for example `delay 10ms reorder 5%`");
  return link;
}

}  // namespace subworld
