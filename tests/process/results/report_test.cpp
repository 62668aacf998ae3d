#include "process/process_test.hpp"

#include <regex>

namespace subworld::test {
namespace {

/// `subworld report` on real runs.
class Report : public ProcessTest {
 protected:
  /// The page of a folder, which refers to nothing elsewhere.
  [[nodiscard]] std::string page_of(const std::string& what, const std::string& folder) const {
    const Ended ended = finish({program("subworld"), "report", what});
    EXPECT_EQ(ended.code, 0) << ended.err;
    EXPECT_NE(ended.out.find("report: " + folder + "/report.html"), std::string::npos) << ended.out;
    const std::string text = read_text(folder + "/report.html");
    static const std::regex kElsewhere(
        "(src|href)\\s*=\\s*[\"']?\\s*(https?:)?//|<script\\s+src|<link|@import|url\\(\\s*[\"']?http");
    EXPECT_FALSE(std::regex_search(text, kElsewhere));
    EXPECT_NE(text.find("</html>"), std::string::npos);
    return text;
  }
  /// The exact numbers of the row of a user in a table; empty where the table has no such column.
  static std::string number_in(const std::string& page, const std::string& table, const std::string& column,
                               const std::string& user) {
    const std::size_t begin = page.find("data-name=\"" + table + "\"");
    if (begin == std::string::npos) return "";
    const std::string text = page.substr(begin, page.find("</table>", begin) - begin);
    std::istringstream lines(text);
    std::string head, line;
    std::getline(lines, head);
    const std::size_t place = cell_of(head, "<th", column);
    while (std::getline(lines, line)) {
      if (line.find(">" + user + "</td>") == std::string::npos) continue;
      std::size_t at = 0;
      for (std::size_t i = 0; i <= place; ++i) at = line.find("<td", at) + 1;
      const std::size_t value = line.find("value=\"", at) + 7;
      return line.substr(value, line.find('"', value) - value);
    }
    return "";
  }

 private:
  static std::size_t cell_of(const std::string& line, const std::string& tag, const std::string& words) {
    const std::size_t end = line.find(">" + words + "<");
    EXPECT_NE(end, std::string::npos) << words << " is no column of " << line;
    std::size_t count = 0;
    for (std::size_t at = line.find(tag); at < end; at = line.find(tag, at + 1)) ++count;
    return count - 1;
  }
};

TEST_F(Report, IsDrawnWhateverTheTemporaryFolderIsCalled) {
  const std::string quoted = folder_.path() + "/it's a folder; exit 3";
  std::filesystem::create_directory(quoted);
  for (const std::string& temporary : {quoted, std::string("/nowhere")}) {
    const Environment environment{{"TMPDIR", temporary}};
    ASSERT_EQ(run(scene("press"), {"--duration", "0.1"}, environment).code, 0) << temporary;
    const Ended ended = finish({program("subworld"), "report", out()}, environment);
    EXPECT_EQ(ended.code, 0) << ended.err;
  }
}

TEST_F(Report, HasTheFiguresOfTheSummary) {
  ASSERT_EQ(run(scene("lift"), {"--mode", "lockstep", "--duration", "0.5", "--users", "2"}).code, 0);
  const std::string page = page_of(out(), out());
  const Json all = summary();
  EXPECT_NE(page.find("Verdict: <b>" + all["verdict"].get<std::string>()), std::string::npos);
  EXPECT_NE(page.find(all["state_hash"].get<std::string>()), std::string::npos);
  EXPECT_NE(page.find("lock-step, 0.5 s, scheme reduced"), std::string::npos);
  for (const Json& gate : all["gates"])
    EXPECT_NE(page.find(gate["name"].get<std::string>()), std::string::npos) << gate;
  ASSERT_EQ(all["haptic"].size(), 2U);
  for (std::size_t u = 0; u < 2; ++u) {
    const std::string user = all["settings"]["users"][u]["name"];
    const Json& haptic = all["haptic"][u];
    const auto expect = [&](const char* table, const char* column, double value) {
      EXPECT_NEAR(std::atof(number_in(page, table, column, user).c_str()), value, 1e-9 * std::abs(value)) << column;
    };
    expect("force", "force RMS N", haptic["force_rms_n"]);
    expect("force", "force max N", haptic["force_max_n"]);
    expect("force", "largest step N", haptic["force_step_max_n"]);
    expect("time", "steps", haptic["steps"]);
    expect("time", "missed", haptic["missed_deadlines"]);
    expect("time", "step p99 ms", 1e3 * haptic["step_s"]["p99"].get<double>());
    expect("sub_world", "members max", haptic["members"]["max"]);
  }
  EXPECT_NEAR(std::atof(number_in(page, "world", "value", "cycles").c_str()), all["world"]["cycles"].get<double>(),
              0.0);
  for (const char* plot : {"Force on the operator", "Energy of the bodies", "Time of a haptic step"})
    EXPECT_NE(page.find(plot), std::string::npos) << plot;
  EXPECT_EQ(page.find("Late steps"), std::string::npos) << "lock-step has no deadlines";
  EXPECT_EQ(page_of(out() + "/summary.json", out()), page) << "the same for a file in the folder";
  const std::string foreign = folder_.write("notes.html", "mine");
  const Ended refused = finish({program("subworld"), "report", out(), "--out", foreign});
  EXPECT_EQ(refused.code, 2) << refused.out;
  EXPECT_EQ(read_text(foreign), "mine") << refused.err;
  ASSERT_EQ(run(scene("first"), {"--mode", "lockstep", "--duration", "0.1"}).code, 0);
  EXPECT_FALSE(std::filesystem::exists(out() + "/report.html")) << "it belongs to the run before";
}

TEST_F(Report, InRealTimeItShowsDeadlinesAndPictures) {
  ASSERT_EQ(run(scene("press"), {"--mode", "realtime", "--duration", "1", "--gui"}).code, 0);
  const std::string page = page_of(out(), out());
  for (const char* part : {"Late steps", "Lateness", "data:image/png;base64,", "by the OS"})
    EXPECT_NE(page.find(part), std::string::npos) << part;
}

// A run whose user was killed has a partial summary.
TEST_F(Report, ShowsWhatAFailedRunHasMeasured) {
  Process process(run_words(scene("press"), {"--mode", "realtime", "--duration", "100"}), folder_.path());
  ASSERT_TRUE(eventually([&] { return read_table(out() + "/haptic_0.csv").rows.size() > 300; }));
  for (const Running& one : running(folder_.path())) {
    if (one.words.front().ends_with("haptic_sim")) kill(one.pid, SIGKILL);
  }
  EXPECT_EQ(process.wait(), 1);
  const std::string page = page_of(out(), out());
  for (const char* part : {"failed: haptic_sim_0 killed by SIGKILL", "no orderly end", "<svg", "verdict fault"})
    EXPECT_NE(page.find(part), std::string::npos) << part;
}

TEST_F(Report, NamesWrongResultsWithTheCure) {
  const auto expect = [&](const std::string& what, int code, const std::string& words) {
    const Ended ended = finish({program("subworld"), "report", what});
    EXPECT_EQ(ended.code, code) << ended.err;
    EXPECT_NE(ended.err.find(words), std::string::npos) << ended.err;
  };
  expect(folder_.path() + "/none", 2, "no such folder or file");
  std::filesystem::create_directories(out());
  expect(out(), 2, "has no summary.json");
  folder_.write("out/summary.json", "{\"verdict\": \"o");
  expect(out(), 1, "summary.json");
  folder_.write("out/summary.json", R"({"lab": "../../x", "verdict": "ok"})");
  expect(out(), 1, "no lab is called");
  folder_.write("out/summary.json", R"({"lab": "plan", "verdict": "ok"})");
  expect(out(), 1, "another version of this lab");
  folder_.write("out/summary.json", R"({"scene": "a", "verdict": "ok"})");
  const Ended ended = finish({program("subworld"), "report", out(), "--out", folder_.path() + "/none/a.html"});
  EXPECT_EQ(ended.code, 1);
  EXPECT_NE(ended.err.find("No such file or directory"), std::string::npos) << ended.err;
}

/// Clicks in the page, and says in its title whether they did what they should.
constexpr const char* kClicks = R"(<script>
const table = document.querySelector('[data-name=world]');
const column = (at) => [...table.rows].slice(1).map((row) => row.cells[at].textContent);
const numbers = () => [...table.querySelectorAll('data')].map((one) => Number(one.value));
const rises = (all) => all.every((one, i) => i === 0 || all[i - 1] <= one);
const before = column(0).join();
table.rows[0].cells[1].click();
const up = rises(numbers()) && column(0).join() !== before;
table.rows[0].cells[1].click();
const down = rises(numbers().reverse());
let file = '';
URL.createObjectURL = (blob) => {
  blob.text().then((text) => {
    const lines = text.trim().split('\n');
    const exact = lines.some((line) => line.startsWith('cycles,' + CYCLES + ',,'));
    document.title = [up, down, lines[0], lines.length === table.rows.length, exact, file].join(' ');
  });
  return 'data:,';
};
HTMLAnchorElement.prototype.click = function () { file = this.download; };
table.parentElement.nextElementSibling.click();
</script></body>)";

TEST_F(Report, ItsTablesAreSortedAndSavedInABrowser) {
  ASSERT_TRUE(std::filesystem::exists("/usr/bin/chromium")) << "chromium is not installed; tests/run installs it";
  ASSERT_EQ(run(scene("press"), {"--mode", "lockstep", "--duration", "0.3"}).code, 0);
  std::string page = page_of(out(), out()), clicks = kClicks;
  clicks.replace(clicks.find("CYCLES"), 6, summary()["world"]["cycles"].dump());
  page.replace(page.rfind("</body>"), 7, clicks);
  const std::string file = folder_.write("clicked.html", page);
  const Ended ended = finish({"/usr/bin/chromium", "--headless", "--no-sandbox", "--disable-gpu",
                              "--user-data-dir=" + folder_.path() + "/browser", "--virtual-time-budget=5000",
                              "--dump-dom", "file://" + file});
  EXPECT_NE(ended.out.find("<title>true true figure,value,unit,meaning true true world.csv</title>"), std::string::npos)
      << ended.out.substr(0, ended.out.find("<style>"))
      << ended.out.substr(std::min(ended.out.size(), ended.out.find("<title>")), 200);
}

/// deploy/results/subworld_results.py on real results.
class PythonResults : public ProcessTest {
 protected:
  void SetUp() override {
    ASSERT_EQ(finish({kPython, "-c", "import pandas"}).code, 0) << "python3-pandas is missing; tests/run installs it";
  }
  [[nodiscard]] Ended python(const std::string& script, Words words) const {
    words.insert(words.begin(), {kPython, "-B", std::string(SOURCE_FOLDER) + script});
    return finish(words, {{"PYTHONPATH", std::string(SOURCE_FOLDER) + "/deploy/results"}});
  }
  void expect_checked(const std::string& what, const std::string& folder) const {
    const Ended ended = python("/tests/support/results_client/check.py", {what, folder});
    EXPECT_EQ(ended.code, 0) << ended.err;
    EXPECT_NE(ended.out.find("checked " + what), std::string::npos) << ended.out;
  }
  static constexpr const char* kPython = "/usr/bin/python3";
};

TEST_F(PythonResults, OfARunAgreeWithItsSummary) {
  ASSERT_EQ(run(scene("lift"), {"--mode", "lockstep", "--duration", "0.5", "--users", "2", "--bodies", "all"}).code, 0);
  expect_checked("run", out());
  // The last row of a killed program.
  std::ofstream(out() + "/world.csv", std::ios::app) << "0.5,1,";
  expect_checked("run", out());
  if (finish({kPython, "-c", "import matplotlib"}).code != 0) return;
  for (const char* plot : {"force", "lateness"}) {
    const std::string picture = folder_.path() + "/" + plot + ".png";
    const Ended ended = python("/deploy/results/examples.py", {plot, out(), "--out", picture});
    EXPECT_EQ(ended.code, 0) << ended.err;
    EXPECT_TRUE(std::filesystem::exists(picture));
  }
}

class PythonModules : public PythonResults, public ::testing::WithParamInterface<const char*> {};

TEST_P(PythonModules, Work) {
  const Ended ended = finish(
      {kPython, "-B", std::string(SOURCE_FOLDER) + "/tests/support/python_client/check.py", GetParam(), folder_.path()},
      {{"PYTHONPATH", program("python")}});
  EXPECT_EQ(ended.code, 0) << ended.err << ended.out;
}

INSTANTIATE_TEST_SUITE_P(RealTime, PythonModules, ::testing::Values("live"),
                         [](const auto& one) { return std::string(one.param); });
INSTANTIATE_TEST_SUITE_P(Checks, PythonModules,
                         ::testing::Values("staircases", "orders", "study", "module", "core", "page", "mistakes"),
                         [](const auto& one) { return std::string(one.param); });

TEST_F(PythonResults, OfALabAreItsTables) {
  const Ended ended = finish({program("subworld"), "lab", "coupling", "press", "--quick", "--scheme", "direct,reduced",
                              "--ratio", "4", "--out", out()});
  ASSERT_EQ(ended.code, 0) << ended.err;
  expect_checked("lab", out());
}

TEST_F(PythonResults, SayWhatIsWrongWithAFolder) { expect_checked("errors", folder_.path()); }

}  // namespace
}  // namespace subworld::test
