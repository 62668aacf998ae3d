#pragma once

#include "process/process_test.hpp"

#include <regex>

namespace subworld::test {

/// `subworld lab NAME`.
class LabTest : public ProcessTest {
 protected:
  explicit LabTest(std::string lab) : lab_(std::move(lab)) {}

  [[nodiscard]] Words lab_words(const Words& rest) const {
    Words words{program("subworld"), "lab", lab_};
    words.insert(words.end(), rest.begin(), rest.end());
    return words;
  }
  /// Flags, and the words that the message must contain.
  using Wrong = std::vector<std::pair<Words, Words>>;
  void expect_refused(const Wrong& wrong) const {
    for (const auto& [flags, fragments] : wrong) {
      Words words = lab_words(flags);
      words.insert(words.end(), {"--out", out()});
      const Ended ended = finish(words);
      EXPECT_EQ(ended.code, 2) << ended.err;
      for (const std::string& fragment : fragments) EXPECT_NE(ended.err.find(fragment), std::string::npos) << ended.err;
    }
  }
  /// Interrupts the lab when it has printed `point`, and checks that the measurements until then are saved.
  void expect_kept_after_interrupt(Words words, const std::string& point, int points, int planned) const {
    words.insert(words.end(), {"--out", out()});
    Process lab(lab_words(words), folder_.path());
    ASSERT_TRUE(eventually([&] { return lab.out().find(point) != std::string::npos; }));
    lab.signal(SIGINT);
    EXPECT_EQ(lab.wait(), 0);
    EXPECT_NE(lab.out().find("stopped by SIGINT"), std::string::npos) << lab.out();
    EXPECT_GE(summary()["points"], points);
    EXPECT_EQ(summary()["planned"], planned);
    EXPECT_TRUE(std::filesystem::exists(out() + "/results.csv"));
    EXPECT_TRUE(std::filesystem::exists(out() + "/report.html"));
  }
  [[nodiscard]] Json results() const { return Json::parse(read_text(out() + "/results.json"), nullptr, false); }
  void expect_columns(const std::vector<std::string>& columns) const {
    std::istringstream csv(read_text(out() + "/results.csv"));
    std::string header;
    std::getline(csv, header);
    for (const std::string& column : columns)
      EXPECT_NE(("," + header + ",").find("," + column + ","), std::string::npos) << column;
  }
  /// The self-contained page.
  [[nodiscard]] std::string page() const {
    const std::string text = read_text(out() + "/report.html");
    static const std::regex kElsewhere(
        "(src|href)\\s*=\\s*[\"']?\\s*(https?:)?//|<script\\s+src|<link|@import|url\\(\\s*[\"']?http");
    EXPECT_FALSE(std::regex_search(text, kElsewhere));
    EXPECT_NE(text.find("<svg"), std::string::npos);
    EXPECT_NE(text.rfind("</html>"), std::string::npos);
    return text;
  }
  /// `subworld report` writes the same page from the tables of the lab.
  void expect_same_page_again() const {
    const std::string before = page();
    std::filesystem::remove(out() + "/report.html");
    const Ended ended = finish({program("subworld"), "report", out()});
    ASSERT_EQ(ended.code, 0) << ended.err;
    EXPECT_TRUE(page() == before) << "differs from what the lab wrote";
  }

 private:
  std::string lab_;
};

}  // namespace subworld::test
