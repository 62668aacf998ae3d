#include "link/settings.hpp"
#include "link_check/statistics.hpp"
#include "link_check/validate.hpp"
#include "model/error.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

namespace subworld {
namespace {

TEST(LinkSettings, ReadsTheOptionsOfNetem) {
  const LinkSettings link = parse_link(
      "delay 20ms 5ms distribution normal loss gemodel 1% 25% 90% 0.1% duplicate 2% reorder 3% gap 4 rate 10mbit limit "
      "50 "
      "outage from 1s for 200ms every 5s");
  EXPECT_DOUBLE_EQ(link.delay_s, 0.02);
  EXPECT_DOUBLE_EQ(link.jitter_s, 0.005);
  EXPECT_EQ(link.shape, JitterShape::normal);
  EXPECT_EQ(link.loss, (LossModel{.p = 0.01, .r = 0.25, .loss_in_bad = 0.9, .loss_in_good = 0.001}));
  EXPECT_DOUBLE_EQ(link.duplicate_ratio, 0.02);
  EXPECT_DOUBLE_EQ(link.reorder_ratio, 0.03);
  EXPECT_EQ(link.reorder_gap, 4);
  EXPECT_DOUBLE_EQ(link.rate_bit_s, 1e7);
  EXPECT_EQ(link.limit, 50);
  EXPECT_EQ(link.outage, (Outage{.from_s = 1.0, .for_s = 0.2, .every_s = 5.0}));
  EXPECT_EQ(parse_link(to_text(link)), link);
}

TEST(LinkSettings, OtherSpellingsAreEqual) {
  EXPECT_EQ(parse_link("delay 20ms jitter 5ms loss 2%"), parse_link("loss random 2% delay 0.02s 5000us"));
  EXPECT_EQ(parse_link("rate 1000kbit"), parse_link("rate 1mbit"));
  EXPECT_EQ(parse_link(""), LinkSettings{});
  EXPECT_EQ(parse_link("ideal"), LinkSettings{});
}

TEST(LinkSettings, PresetsCanBeChanged) {
  const LinkSettings wifi = parse_link("wifi");
  EXPECT_DOUBLE_EQ(wifi.delay_s, 0.015);
  EXPECT_DOUBLE_EQ(wifi.jitter_s, 0.01);
  EXPECT_DOUBLE_EQ(wifi.loss.loss_ratio(), 0.08);
  LinkSettings without = wifi;
  without.loss = {};
  EXPECT_EQ(parse_link("wifi loss 0%"), without);
  EXPECT_DOUBLE_EQ(parse_link("delay 1ms 4g").delay_s, 0.05) << "the later word wins";
  for (const LinkPreset& preset : link_presets()) {
    const LinkSettings link = parse_link(preset.name);
    EXPECT_EQ(parse_link(to_text(link)), link) << preset.name;
  }
}

TEST(LinkSettings, MessagesNameTheWordTheFaultAndTheCure) {
  struct Wrong {
    const char* text;
    std::vector<std::string> says;
  };
  const std::vector<Wrong> all{
      {"delay 20", {"delay", "\"20\"", "ms", "delay 20ms"}},
      {"delay", {"delay", "missing", "20ms"}},
      {"delay -1ms", {"delay", "0 to 60 s"}},
      {"delay 20ms 5ms 25%", {"correlation", "gemodel"}},
      {"loss 2", {"loss", "\"2\"", "2%"}},
      {"loss 200%", {"loss", "0 to 100 %"}},
      {"loss nan%", {"loss", "nan%"}},
      {"loss gemodel 2% 0%", {"gemodel", "never recovers"}},
      {"rate 10mbps", {"rate", "mbit"}},
      {"limit 0", {"limit", "1 to 100000"}},
      {"limit 2.5", {"limit", "2.5"}},
      {"distribution gauss", {"gauss", "normal"}},
      {"reorder 5%", {"reorder", "needs a delay"}},
      {"outage from 2s", {"outage", "for 1s"}},
      {"outage for 2s every 1s", {"every", "longer"}},
      {"wify", {"wify", "starlink", "did you mean wifi?"}},
      {"deley 20ms", {"deley", "did you mean delay?"}},
  };
  for (const Wrong& wrong : all) {
    try {
      static_cast<void>(parse_link(wrong.text));
      ADD_FAILURE() << wrong.text << " is accepted";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::usage);
      for (const std::string& part : wrong.says)
        EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << part << " is not in: " << error.what();
    }
  }
}

/// What a validation finds in what a link of `measured` delivers where `requested` was asked for.
std::string missed(const std::string& requested, const std::string& measured, double late_s = 0.0) {
  LinkStatistics statistics = expected_statistics(parse_link(measured), 5000, 0.001, 64);
  statistics.delay_mean_s += late_s;
  for (double& delay : statistics.delays_s) delay += late_s;
  std::string all;
  for (const LinkCheck& check : judge(parse_link(requested), statistics, 0.001, 64)) {
    if (!check.ok()) all += (all.empty() ? "" : ", ") + check.quantity;
  }
  return all;
}

TEST(LinkValidation, ARightLinkPasses) {
  for (const LinkPreset& preset : link_presets()) EXPECT_EQ(missed(preset.name, preset.name), "") << preset.name;
  EXPECT_EQ(missed("delay 10ms", "delay 10ms", 0.00015), "") << "0.15 ms late";
}

TEST(LinkValidation, AWrongLinkIsFound) {
  EXPECT_EQ(missed("delay 5ms", "delay 5ms", 0.0003), "delay mean, delay p1, delay p50, delay p99");
  EXPECT_NE(missed("delay 20ms 5ms", "delay 20ms").find("jitter"), std::string::npos);
  EXPECT_NE(missed("delay 20ms 5ms", "delay 20ms 2.9ms distribution normal").find("delay p1"), std::string::npos);
  EXPECT_EQ(missed("loss 8%", "loss 10%"), "loss");
  EXPECT_EQ(missed("loss 0%", "loss 0.1%"), "loss");
  EXPECT_NE(missed("loss gemodel 2% 20%", "loss 9.09%").find("lost in a row"), std::string::npos);
  EXPECT_EQ(missed("duplicate 2%", "duplicate 5%"), "duplicates");
  EXPECT_NE(missed("delay 5ms", "delay 5ms reorder 3%").find("delay p1"), std::string::npos);
  EXPECT_NE(missed("delay 5ms 5ms", "delay 5ms 5ms rate 100mbit").find("out of order"), std::string::npos);
}

}  // namespace
}  // namespace subworld
