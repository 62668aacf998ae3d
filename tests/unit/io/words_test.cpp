// Old words must not return, and the pages must be readable.
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <regex>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

namespace {

/// How the lines are prepared before a pattern is searched.
enum class In {
  words,  ///< lower case, identifiers split into words: "TheHand" and "the_hand" become "the hand"
  code,   ///< as written
};

struct OldWord {
  In in;
  const char* stem;  ///< without it the pattern cannot match: much faster than the pattern
  const char* pattern;
  const char* instead;
  const char* bad;   ///< a line that must be found
  const char* good;  ///< a line that must not be found
};

const std::vector<OldWord>& old_words() {
  static const std::vector<OldWord> kAll{
      {In::words, "hand", R"(\bhands?\b)", "operator", "the force on the hand",
       "a program started by hand; name: hand"},
      {In::words, "aslant", R"(\baslant\b)", "oblique", "pressed aslant on the floor", "a slanted plane"},
      {In::words, "blow", R"(\bblows?\b)", "impact", "TEST(Ghost, ABlowIsNoFriction)", "below the plane"},
      {In::words, "sw", R"(\b(swings?|swinging|swung)\b)", "oscillates", "the force swings", "the force oscillates"},
      {In::words, "floor",
       R"(\b((reference|noise|error) floors?|floors? of (the|a|its|their) (reference|error)|at floor|telling floor)\b)",
       "reference error", "a point at the floor of its reference", "a cube on the floor; std::floor(x)"},
      {In::words, "clock factor", R"(\bclock factors?\b)", "real-time factor", "double clock_factor = 1.0;",
       "real_time_factor"},
      {In::words, "out", R"(\b(left|leaves?|leaving) out\b)", "the optimisation is on, or: omitted, skipped",
       "the plan leaves out friction", "left, outside"},
      {In::words, "in", R"(\b(kept|keeps?|keeping) in\b)", "the optimisation is off", "an item kept in",
       "the path is kept; in"},
      {In::words, "silence", R"(\bsilences?\b)", "message suppression, or: absence of messages",
       "while the silence lasts", "a silent program"},
      {In::words, "stranger", R"(\bstrangers?\b)", "foreign writer", "a stranger's samples", "a strange shape"},
      {In::words, "go", R"(\b(lets?|letting) go\b)", "declutch", "void let_go();", "let the loop go on"},
      {In::words, "anew", R"(\b(met|meets?) anew\b)", "re-engage", "TEST(Control, AToolIsMetAnew)", "the boxes meet"},
      {In::words, "clutch", R"(\bclutch\b)", "declutch", "class Clutch {", "class Declutch {"},
      {In::words, "m",
       R"(\b((missed|late) by (the machine|machine|us)|by the machine|the machine's (share|lateness))\b)",
       "by the OS, by the run", "deadlines missed by the machine", "the machine's steady clock"},
      {In::words, "parts", R"(\b(in how many parts|parts of (a|the|each|its) (world's )?(cycle|step)s?)\b)",
       "sub-steps", "the parts of a cycle", "parts of a message"},
      {In::code, "part_s", R"(\bpart_s\b)", "integration_substep_s", "double part_s = 0.0;", "double depart_s = 0.0;"},
      {In::code, "lead_s", R"(\blead_s\b)", "half_step_offset_s", "double lead_s = 0.0;",
       "double half_step_offset_s = 0.0;"},
      {In::words, "grip", R"(^(?!.*verse).*\bgrips?\b)", "load_dependent_friction", "Vec3 grip;",
       "Vec3 gripper_place;"},
      {In::words, "hang", R"(\bhangs? on\b)", "attach, or: is connected to", "void hang_on(BodyId id);",
       "a program that hangs; on"},
      {In::words, "told", R"(\btold\b)", "published_state, or: states, reports", "the body was told", "a stolen core"},
      {In::code, "BorderPair", R"(\bBorderPair\b)", "BoundaryContact", "std::vector<BorderPair> border;",
       "border_pairs"},
      {In::code, "Conductor", R"(\bConductor\b)", "RunControl", "class Conductor {", "class SemiConductors {"},
      {In::words, "rouse", R"(\brouses?\b)", "handshake", "void rouse();", "trousers"},
      {In::code, "gather", R"(\bgather\((?!(motions|moved_|pushed_|by_loads|now|then|const ))|\bgather_)",
       "await_peers", "if (!gather(ports)) return;", "BothMotion motion = gather(motions_[a], motions_[b]);"},
      {In::code, "p", R"(\bsubs?(\[\w+\])?(\.|->)apply\(|\bapply\(const WorldFrame|\.adopt\()",
       "synchronise_with, reset_from", "subs[u]->apply(world.frame(u));",
       "std::apply(visit, tuple); apply(row, inverse_mass, by, motion);"},
      {In::code, "", R"(\b(Walk|free_way|blocked_way|Role::loose|Saving|parse_kept|kept_names|leaves_out)\b)",
       "the names in the same places of today's code", "EXPECT_TRUE(leaves_out(scene, item));", "double free_way_m;"},
  };
  return kAll;
}

/// Allowed phrases that contain an old word: verbs, the name `hand` of a user in a scene, keys of the results, and
/// left-out keys of a scene. They are removed before the search.
const std::regex& allowed_words() {
  static const std::regex kAllowed(
      R"(\bby hand\b|\bon the other hand\b|\bhands? (over|on to|its|the same)\b|\boperator's hand\b)"
      R"(|name: hand\b|"hand("|:|/)|\bhand/proxy\b|"hand\\")"
      R"(|\b(key that is|budget) left out\b|["`]left out["`])");
  return kAllowed;
}

/// Lower case, identifiers split into words.
std::string words_of(const std::string& line) {
  std::string out;
  for (std::size_t i = 0; i < line.size(); ++i) {
    const auto c = static_cast<unsigned char>(line[i]);
    if (i > 0 && std::isupper(c) != 0 && std::islower(static_cast<unsigned char>(line[i - 1])) != 0) out += ' ';
    // "AHand": the last upper-case letter before a lower-case one begins a word.
    if (i > 0 && i + 1 < line.size() && std::isupper(c) != 0 &&
        std::isupper(static_cast<unsigned char>(line[i - 1])) != 0 &&
        std::islower(static_cast<unsigned char>(line[i + 1])) != 0)
      out += ' ';
    out += c == '_' ? ' ' : static_cast<char>(std::tolower(c));
  }
  if (out.find("hand") == std::string::npos && out.find("left out") == std::string::npos) return out;
  return std::regex_replace(out, allowed_words(), " ");
}

struct Compiled {
  const OldWord* word;
  std::regex pattern;
};

const std::vector<Compiled>& compiled() {
  static const std::vector<Compiled> kAll = [] {
    std::vector<Compiled> all;
    for (const OldWord& word : old_words()) all.push_back({&word, std::regex(word.pattern, std::regex::optimize)});
    return all;
  }();
  return kAll;
}

bool found(const Compiled& entry, const std::string& line, const std::string& words) {
  const std::string& text = entry.word->in == In::words ? words : line;
  return text.find(entry.word->stem) != std::string::npos && std::regex_search(text, entry.pattern);
}

std::string text_of(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// All text files under the source folder that belong to the project, but this one.
std::vector<std::filesystem::path> files() {
  const std::filesystem::path root = SOURCE_FOLDER;
  std::vector<std::filesystem::path> all;
  for (auto entry = std::filesystem::recursive_directory_iterator(root); entry != decltype(entry){}; ++entry) {
    const std::string name = entry->path().filename().string();
    if (entry.depth() == 0 && (name == "build" || name == "out" || name == ".git" || name == "LICENSE")) {
      entry.disable_recursion_pending();
    } else if (entry->is_regular_file() && name != "words_test.cpp" && name != ".git") {
      all.push_back(entry->path());
    }
  }
  std::sort(all.begin(), all.end());
  return all;
}

TEST(Words, EachPatternFindsItsOldWordAndNoMore) {
  for (const Compiled& entry : compiled()) {
    EXPECT_TRUE(found(entry, entry.word->bad, words_of(entry.word->bad))) << entry.word->pattern;
    EXPECT_FALSE(found(entry, entry.word->good, words_of(entry.word->good))) << entry.word->pattern;
  }
}

TEST(Words, NoOldWordIsUsed) {
  const std::filesystem::path root = SOURCE_FOLDER;
  std::size_t read = 0;
  for (const auto& file : files()) {
    const std::string text = text_of(file);
    if (text.find('\0') != std::string::npos) continue;
    ++read;
    std::istringstream lines(text);
    std::string line;
    for (int number = 1; std::getline(lines, line); ++number) {
      const std::string words = words_of(line);
      for (const Compiled& entry : compiled()) {
        if (!found(entry, line, words)) continue;
        ADD_FAILURE() << file.lexically_relative(root).string() << ":" << number << ": write \"" << entry.word->instead
                      << "\": " << line;
      }
    }
  }
  EXPECT_GT(read, 300U) << "the source folder is incomplete";
}

/// A paragraph, a list item or a table cell of a page, and the line where it begins.
struct Paragraph {
  int line = 0;
  std::string text;
};

/// The prose of a page, without code blocks and headings; a link or inline code is one word.
std::vector<Paragraph> paragraphs_of(const std::string& page) {
  static const std::regex kLink(R"(!?\[([^\]]*)\]\([^)]*\))"), kCode("`[^`]*`"), kItem(R"(([*-]|[0-9]+\.) .*)");
  std::vector<Paragraph> paragraphs;
  std::istringstream lines(page);
  std::string line;
  bool code = false, open = false;
  for (int number = 1; std::getline(lines, line); ++number) {
    std::string content = line.substr(std::min(line.find_first_not_of(' '), line.size()));
    const bool fence = content.starts_with("```");
    if (fence) code = !code;
    if (code || fence || content.empty() || content.starts_with("#")) {
      open = false;
      continue;
    }
    content = std::regex_replace(std::regex_replace(content, kLink, "link"), kCode, "code");
    if (content.starts_with("|")) {
      std::istringstream cells(content);
      for (std::string cell; std::getline(cells, cell, '|');) paragraphs.push_back({number, cell});
      open = false;
      continue;
    }
    if (!open || std::regex_match(content, kItem)) paragraphs.push_back({number, ""});
    open = true;
    paragraphs.back().text += content + " ";
  }
  return paragraphs;
}

/// The sentences of a paragraph: they end with ., ! or ? before a space.
std::vector<std::string> sentences_of(const std::string& paragraph) {
  std::vector<std::string> sentences(1);
  for (std::size_t i = 0; i < paragraph.size(); ++i) {
    const char c = paragraph[i];
    sentences.back() += c;
    const bool last = i + 1 == paragraph.size() || paragraph[i + 1] == ' ';
    if ((c == '.' || c == '!' || c == '?') && last) sentences.emplace_back();
  }
  return sentences;
}

std::size_t word_count(const std::string& sentence) {
  std::istringstream stream(sentence);
  std::size_t count = 0;
  for (std::string word; stream >> word;) {
    count += std::ranges::any_of(word, [](unsigned char c) { return std::isalnum(c) != 0; }) ? 1U : 0U;
  }
  return count;
}

/// "LINE: COUNT words: SENTENCE" for each sentence that is too long.
std::vector<std::string> long_sentences(const std::string& page) {
  constexpr std::size_t kMostWords = 25;
  std::vector<std::string> found;
  for (const Paragraph& paragraph : paragraphs_of(page)) {
    for (const std::string& sentence : sentences_of(paragraph.text)) {
      const std::size_t count = word_count(sentence);
      if (count > kMostWords)
        found.push_back(std::to_string(paragraph.line) + ": " + std::to_string(count) + " words:" + sentence);
    }
  }
  return found;
}

TEST(Pages, TheSplitterFindsLongSentencesOnly) {
  std::string words;
  for (int i = 0; i < 25; ++i) words += "word ";
  EXPECT_TRUE(long_sentences(words + ".").empty());
  EXPECT_EQ(long_sentences("Short one. " + words + "more. Another.").size(), 1U);
  EXPECT_EQ(long_sentences("x\n\n" + words + "\nmore.").front().substr(0, 12), "3: 26 words:");
  EXPECT_TRUE(long_sentences("* " + words + "\n* " + words + "\n12. " + words).empty()) << "items stand alone";
  EXPECT_TRUE(long_sentences("```sh\n" + words + words + "\n```\n# " + words + words).empty());
  EXPECT_TRUE(long_sentences(words + "\n\n" + words).empty());
  EXPECT_TRUE(long_sentences("| " + words + "| " + words + "|").empty()) << "cells stand alone";
  EXPECT_EQ(long_sentences("| x | " + words + "more |").size(), 1U);
  EXPECT_TRUE(long_sentences("`" + words + words + "` [" + words + words + "](page.md)").empty()) << "one word each";
}

TEST(Pages, HaveNoLongSentences) {
  const std::filesystem::path root = SOURCE_FOLDER;
  std::size_t pages = 0;
  for (const auto& file : files()) {
    if (file.extension() != ".md") continue;
    ++pages;
    for (const std::string& found : long_sentences(text_of(file)))
      ADD_FAILURE() << file.lexically_relative(root).string() << ":" << found << " (25 at most)";
  }
  EXPECT_GT(pages, 15U) << "the source folder is incomplete";
}

TEST(Pages, LinkToFilesThatExist) {
  const std::filesystem::path root = SOURCE_FOLDER;
  const std::regex link(R"(\]\(([^)#\s:]+)[)#])");  // no address with a scheme
  std::size_t links = 0;
  for (const auto& file : files()) {
    if (file.extension() != ".md") continue;
    const std::string text = text_of(file);
    for (std::sregex_iterator found(text.begin(), text.end(), link), end; found != end; ++found, ++links) {
      EXPECT_TRUE(std::filesystem::exists(file.parent_path() / (*found)[1].str()))
          << file.lexically_relative(root).string() << ": " << (*found)[1];
    }
  }
  EXPECT_GT(links, 100U);
}

/// The first pages that users read.
TEST(Pages, OfTheEntryAreShort) {
  for (const auto& [page, most] : {std::pair{"README.md", 150}, std::pair{"CHANGELOG.md", 40}}) {
    const std::string text = text_of(std::filesystem::path(SOURCE_FOLDER) / page);
    EXPECT_FALSE(text.empty()) << page;
    EXPECT_LE(std::ranges::count(text, '\n'), most) << page;
  }
}

}  // namespace
