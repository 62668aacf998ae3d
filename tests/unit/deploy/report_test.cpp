// The pages of `subworld report`: what they show, and what they survive.
#include "io/results/json.hpp"
#include "model/error.hpp"
#include "report/page.hpp"
#include "results/envelope.hpp"
#include "results/run_report.hpp"
#include "support/temporary_folder.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <limits>

namespace subworld {
namespace {

constexpr double kNoNumber = std::numeric_limits<double>::quiet_NaN();

std::string page_in(const TemporaryFolder& folder) {
  std::ifstream file(folder.path() + "/report.html");
  return {std::istreambuf_iterator<char>(file), {}};
}

TEST(ReportText, CharactersOfHtmlAreReplaced) {
  EXPECT_EQ(escaped("<b a=\"1\">&'</b>"), "&lt;b a=&quot;1&quot;&gt;&amp;'&lt;/b&gt;");
  EXPECT_EQ(escaped("48 µs"), "48 µs");
}

TEST(ReportText, ANumberIsShownRoundedAndHeldExactly) {
  EXPECT_EQ(shown(6.4912345678, 3), "<data value=\"6.4912345678\">6.49</data>");
  EXPECT_EQ(shown(123456.0, 3), "<data value=\"123456\">123456</data>") << "digits before the point are not rounded";
  EXPECT_EQ(shown(kNoNumber, 3), "&ndash;");
  EXPECT_EQ(shown(HUGE_VAL, 3), "&ndash;");
}

TEST(ReportTable, HasItsNameItsMeaningsAndItsAlignment) {
  const std::string html = html_of(TextTable{
      .head = {"user", "N", "why"}, .rows = {{"a", "1", "b"}}, .remarks = true, .name = "x\"y", .about = {"", "<N>"}});
  EXPECT_NE(html.find("data-name=\"x&quot;y\""), std::string::npos) << html;
  EXPECT_NE(html.find("<th title=\"&lt;N&gt;\">N</th>"), std::string::npos) << html;
  EXPECT_NE(html.find("<td class=text>a</td><td>1</td><td class=text>b</td>"), std::string::npos) << html;
}

TEST(ReportCurve, KeepsEveryPeakInFewPoints) {
  Envelope curve;
  for (int i = 0; i < 100'000; ++i) curve.add(i, i == 54'321 ? 7.0 : i == 777 ? -3.0 : 0.0);
  const auto points = curve.points();
  EXPECT_LE(points.size(), 2 * Envelope::kBins);
  EXPECT_NE(std::ranges::find(points, std::pair(54'321.0, 7.0)), points.end());
  EXPECT_NE(std::ranges::find(points, std::pair(777.0, -3.0)), points.end());
  EXPECT_TRUE(std::ranges::is_sorted(points, {}, &std::pair<double, double>::first));
  EXPECT_EQ(curve.largest(), 7.0);
}

TEST(ReportCurve, SkipsWhatIsNoNumber) {
  Envelope curve;
  curve.add(kNoNumber, 1.0);
  curve.add(1.0, HUGE_VAL);
  EXPECT_TRUE(curve.empty());
  curve.add(2.0, 3.0);
  EXPECT_EQ(curve.points(), (std::vector<std::pair<double, double>>{{2.0, 3.0}}));
}

TEST(ReportValues, AnyKeyMayBeMissing) {
  const Json json = Json::parse(R"({"a": {"b": [1, {"c": "x"}, null]}, "t": true})");
  EXPECT_EQ(number_at(json, "a/b/0"), 1.0);
  EXPECT_EQ(text_at(json, "a/b/1/c"), "x");
  EXPECT_EQ(text_at(json, "t"), "true");
  for (const char* path : {"a/b/2", "a/b/3", "a/b/x", "a/x/0", "x", "a/b/0/c"}) {
    EXPECT_TRUE(std::isnan(number_at(json, path))) << path;
    EXPECT_EQ(text_at(json, path), "") << path;
  }
}

/// The message of the error for these results.
std::string refusal(const std::string& what) {
  try {
    write_report(place_of({.what = what, .out = ""}));
  } catch (const Error& wrong) {
    return wrong.what();
  }
  return "";
}

TEST(ReportPlace, NamesWhatIsWrongWithTheResults) {
  const TemporaryFolder folder;
  const auto expect = [&](const std::string& what, const std::string& words) {
    EXPECT_NE(refusal(what).find(words), std::string::npos) << refusal(what);
  };
  expect(folder.path() + "/none", "no such folder or file");
  expect(folder.path(), "has no summary.json: no run and no lab has ended here");
  folder.write("haptic_0.csv", "time_s\n");
  expect(folder.path(), "subworld collect");
  for (const char* broken : {"", "{", "{\"verdict\": ", "[1, 2]", "null", "5", "{}", "{\"a\": 1}"}) {
    folder.write("summary.json", broken);
    EXPECT_NE(refusal(folder.path()), "") << broken;
    EXPECT_NE(refusal(folder.path()).find("summary.json"), std::string::npos) << refusal(folder.path());
  }
  folder.write("summary.json", R"({"scene": "row", "verdict": "ok"})");
  EXPECT_EQ(refusal(folder.path()), "");
  EXPECT_EQ(place_of({.what = folder.path() + "/summary.json", .out = ""}).page, folder.path() + "/report.html");
  EXPECT_EQ(place_of({.what = folder.path(), .out = folder.path() + "/a.html"}).page, folder.path() + "/a.html");
  EXPECT_NE(refusal(folder.path() + "/summary.json/x"), "");
  folder.write("summary.json", R"({"lab": "coupling"})");
  EXPECT_EQ(place_of({.what = folder.path(), .out = ""}).lab, "coupling");
}

/// Whatever types the keys have, the page is written.
TEST(RunReport, SurvivesASummaryOfAnyShape) {
  const TemporaryFolder folder;
  for (
      const char* text :
      {R"({"scene": 5, "gates": 3, "haptic": {}, "device": "x", "world": [], "settings": 1, "hosts": 7, "machine": []})",
       R"({"verdict": "ok", "gates": [1, null, {}], "haptic": [null, 3, {"user": "a/b"}], "device": [{}], "restarts": "x"})",
       R"({"verdict": null, "haptic": [{"user": 70, "step_s": {"p50": null}}], "world": {"events": 3, "absences": 1}})",
       R"({"verdict": "failed: x", "partial": true, "world": {"cycles": 3, "to_s": 0.5, "partial": true}})"}) {
    folder.write("summary.json", text);
    EXPECT_EQ(refusal(folder.path()), "") << text;
    EXPECT_NE(page_in(folder).find("</html>"), std::string::npos);
  }
}

TEST(RunReport, NoTextOfARunIsHtml) {
  const TemporaryFolder folder;
  const std::string bad = R"(<script>alert(1)</script>" onload="x)";
  std::string summary = R"({"scene": BAD, "scene_file": BAD, "verdict": BAD, "scheme": BAD, "command_line": BAD,
    "date": BAD, "machine": {"cpu": BAD, "kernel": BAD}, "users": BAD, "ratio": BAD, "session": BAD, "dds": BAD,
    "settings": {"users": [{"name": BAD}], "disabled": [BAD]},
    "gates": [{"name": BAD, "unit": BAD, "why": BAD, "missed_by": BAD}], "hosts": [{"host": BAD}],
    "restarts": [{"program": BAD, "reason": BAD}], "world": {"events": {BAD: 3}, "bodies": BAD},
    "haptic": [{"user": 0, "dds": BAD, "host": BAD, "ending": {"by": BAD}, "machine": {"scheduling": BAD}}]})";
  const std::string quoted = Json(bad).dump();
  for (std::size_t at = 0; (at = summary.find("BAD", at)) != std::string::npos; at += quoted.size())
    summary.replace(at, 3, quoted);
  folder.write("summary.json", summary);
  folder.write("haptic_0.csv",
               "time_s,operator_force_x_n,operator_force_y_n,operator_force_z_n\n0.1,1,2,3\n0.2,nan,1,1\n0.3,inf,1,1\n"
               "0.4,,1,1\n0.5,x,1,1\n0.6,1\n0.7,2,2,1\n");
  ASSERT_EQ(refusal(folder.path()), "");
  const std::string page = page_in(folder);
  EXPECT_EQ(page.find(bad), std::string::npos);
  EXPECT_EQ(page.find("<script>alert"), std::string::npos);
  EXPECT_NE(page.find("&lt;script&gt;alert"), std::string::npos);
  EXPECT_NE(page.find("<svg"), std::string::npos);
  EXPECT_EQ(page.find("NaN,"), std::string::npos) << "in a curve";
}

TEST(RunReport, PicturesAreInThePage) {
  const TemporaryFolder folder;
  EXPECT_EQ(pictures_in(folder.path()), "");
  folder.write("no.png", "not a picture");
  EXPECT_EQ(pictures_in(folder.path()), "");
  folder.write("a<b.png", std::string("\x89PNG\r\n\x1a\n", 8));
  const std::string html = pictures_in(folder.path());
  EXPECT_NE(html.find("src=\"data:image/png;base64,iVBORw0KGgo=\""), std::string::npos) << html;
  EXPECT_NE(html.find("<figcaption>a&lt;b.png</figcaption>"), std::string::npos) << html;
}

// Missed gates come first, and every one says by whom it was missed.
TEST(RunReport, TheVerdictAndItsGatesComeFirst) {
  const TemporaryFolder folder;
  folder.write("summary.json", R"({"scene": "row", "verdict": "quality gate missed: x", "mode": "realtime", "gates": [
    {"name": "energy", "value": 0.5, "bound": 1, "at_most": true, "unit": "J", "ok": true},
    {"name": "factor", "value": 0.25, "bound": 1, "at_most": false, "unit": "1", "ok": false, "missed_by": "run", "why": "slow"}]})");
  ASSERT_EQ(refusal(folder.path()), "");
  const std::string page = page_in(folder);
  const auto at = [&](const char* text) { return page.find(text); };
  EXPECT_LT(at("quality gate missed: x"), at(">factor<"));
  EXPECT_LT(at(">factor<"), at(">energy<"));
  EXPECT_LT(at(">energy<"), at("What was run"));
  EXPECT_NE(at("run: slow"), std::string::npos);
  EXPECT_NE(at("verdict fault"), std::string::npos);
  EXPECT_NE(at("1 of 2 quality gates ok"), std::string::npos);
}

}  // namespace
}  // namespace subworld
