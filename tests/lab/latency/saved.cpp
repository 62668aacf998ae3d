#include "io/results/json.hpp"
#include "lab/latency/report.hpp"
#include "model/error.hpp"

#include <fmt/core.h>

#include <limits>

namespace subworld {

namespace {

Link link_called(const std::string& name) {
  for (const Link link : {Link::world, Link::device, Link::emulated}) {
    if (name == name_of(link)) return link;
  }
  throw Error(ExitCode::failed, fmt::format("there is no link \"{}\"", name));
}

/// The inverse of rows_of(), from the rows of one search.
LatencyAnswer answer_of(const Json& settings, const Criteria& bounds, const Rows& rows) {
  LatencyAnswer answer;
  answer.settings = settings;
  answer.sentence = settings.at("sentence");
  answer.finished = settings.at("finished");
  std::vector<std::vector<Sample>> samples;
  for (const Json& row : rows) {
    if (!alike(row, settings, {"scene", "link", "jitter_s", "loss_ratio"})) continue;
    const auto u = row.at("user").get<std::size_t>();
    if (u >= answer.limits.size()) {
      answer.limits.resize(u + 1);
      answer.reference.resize(u + 1);
      samples.resize(u + 1);
    }
    answer.limits[u].name = row.at("user_name");
    answer.limits[u].undecided = row.at("undecided");
    answer.reference[u][Criterion::rms] = number(row, "reference_error");
    if (row.at("kind") != "point") continue;
    const std::string disturbed = row.at("disturbed");
    Sample& sample = samples[u].emplace_back();
    sample.disturbed = !disturbed.empty();
    sample.delay_s = number(row, "delay_s");
    for (const CriterionText& text : kCriterionTexts) sample.values[text.criterion] = number(row, text.column);
    if (answer.runs.empty() || answer.runs.back().delay_s != sample.delay_s)
      answer.runs.push_back({sample.delay_s, row.at("starts"), {}, disturbed});
    answer.runs.back().users.resize(u + 1);
    answer.runs.back().users[u] = sample.values;
  }
  for (std::size_t u = 0; u < answer.limits.size(); ++u) answer.limits[u].limit = limit_of(samples[u], bounds);
  return answer;
}

}  // namespace

LatencyFindings saved_searches(const std::string& folder) {
  LatencyFindings found{.questions = {}, .answers = {}, .summary = read_json(folder + "/summary.json")};
  const Rows rows = read_rows(folder + "/results.json");
  Criteria bounds;
  for (const CriterionText& text : kCriterionTexts) {
    const Json& bound = found.summary.at("bounds").at(text.column);
    bounds[text.criterion] = bound.is_null() ? std::numeric_limits<double>::infinity() : bound.get<double>();
  }
  for (const Json& settings : found.summary.at("answers")) {
    LatencyQuestion& question = found.questions.emplace_back();
    question.link = link_called(settings.at("link"));
    question.bounds = bounds;
    found.answers.push_back(answer_of(settings, bounds, rows));
  }
  return found;
}

}  // namespace subworld
