#include <gmock/gmock.h>

#include <cstdlib>
#include <map>
#include <sstream>

#include "tests/test_data.h"
#include "tileflight/core/base/files.h"
#include "tileflight/tiles/fetch/test_tilesets.h"
#include "tileflight/tiles/tile_content/content.h"
#include "tileflight/tiles/tile_content/json_reader.h"
#include "tileflight/tiles/tileset/inspect.h"
#include "tileflight/tiles/tileset/load.h"
#include "tileflight/tiles/tileset/subtree.h"

/// Outcome for every available broken file: read, or one error line.
namespace tileflight::tileset::fault_table_test {
namespace {

namespace fs = std::filesystem;
using base::test_support::error_of;
using ::testing::HasSubstr;
using ::testing::Not;

enum class Kind { kTileset, kContent, kSubtree, kSchema, kPart };

bool is_one_of(const std::string& ending, std::initializer_list<const char*> endings) {
  return std::find(endings.begin(), endings.end(), ending) != endings.end();
}

Kind kind_of(const fs::path& file) {
  const std::string ending = file.extension();
  const std::string folder = file.parent_path().filename();
  if (ending == ".subtree" || (ending == ".json" && folder == "subtrees")) return Kind::kSubtree;
  if (ending == ".json" && folder == "schemas") return Kind::kSchema;
  if (is_one_of(ending, {".json", ".3tz", ".3dtiles"})) return Kind::kTileset;
  if (is_one_of(ending, {".bin", ".md", ".tsv", ".txt", ".input"})) return Kind::kPart;
  return Kind::kContent;
}

void read_subtree(const fs::path& file) {
  auto tiling = std::make_shared<ImplicitTiling>();
  tiling->subtree_levels = 3;
  tiling->available_levels = 6;
  tiling->content_templates = {"content"};
  tiling->root_volume = OrientedBox{geometry::Vec3::Zero(), geometry::Mat3::Identity()};
  parse_subtree(base::read_bytes(file), {tiling, {}}, file.filename(),
                [&](const std::string& uri) { return base::read_bytes(file.parent_path() / uri); });
}

void read_content(const fs::path& file) {
  tile_content::ContentOptions options;
  options.read_resource = [&](const std::string& uri) { return base::read_bytes(file.parent_path() / uri); };
  options.read_image = [&](const std::string&) { return std::make_shared<imaging::RgbImage>(1, 1); };
  tile_content::decode_content(base::read_bytes(file), file.filename(), options);
}

/// Error message of reading a file; empty: it was read.
std::string fate_of(const fs::path& file, Kind kind) {
  return base::test_support::error_of([&] {
    if (kind == Kind::kSubtree) return read_subtree(file);
    if (kind == Kind::kContent) return read_content(file);
    if (kind == Kind::kSchema) {
      tile_content::parse_metadata_schema(tile_content::parse_json(base::read_text(file), file.filename()),
                                          file.filename());
      return;
    }
    inspect_tileset(file.string());
    load_region(file.string(), {});
  });
}

/// Number of faults in each file according to the validator's authors.
std::map<std::string, int> expected_issues(const fs::path& table) {
  std::map<std::string, int> out;
  std::istringstream lines(base::read_text(table));
  for (std::string line; std::getline(lines, line);) {
    const std::size_t tab = line.find('\t');
    if (tab != std::string::npos) out[line.substr(0, tab)] = std::atoi(line.c_str() + tab + 1);
  }
  return out;
}

/// With TILEFLIGHT_FAULT_TABLE=FILE a table is written there: file, number of faults known to its authors, message.
TEST(FaultTable, EveryFileIsReadOrNamedInOneLine) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "invalid/validator_specs");
  const std::map<std::string, int> issues = expected_issues(folder / "EXPECTED_ISSUES.tsv");
  std::vector<fs::path> files;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file() && kind_of(entry.path()) != Kind::kPart) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  std::string table = "file\tfaults known\tfate\n";
  std::map<Kind, std::array<int, 2>> counts;  // read, refused
  for (const fs::path& file : files) {
    const std::string name = fs::relative(file, folder);
    const Kind kind = kind_of(file);
    const std::string message = fate_of(file, kind);
    EXPECT_THAT(message, Not(HasSubstr("\n"))) << name;
    EXPECT_LT(message.size(), 1000U) << name;
    ++counts[kind][message.empty() ? 0 : 1];
    const auto known = issues.find(name);
    table += name + "\t" + (known == issues.end() ? "" : std::to_string(known->second)) + "\t" +
             (message.empty() ? "read" : message) + "\n";
  }
  for (const auto& [kind, count] : counts) {
    table += "total of kind " + std::to_string(static_cast<int>(kind)) + "\t\t" + std::to_string(count[0]) + " read, " +
             std::to_string(count[1]) + " refused\n";
  }
  EXPECT_GT(files.size(), 550U);
  EXPECT_GT(counts[Kind::kTileset][1], 100);
  EXPECT_GT(counts[Kind::kContent][0], 20);
  if (const char* out = std::getenv("TILEFLIGHT_FAULT_TABLE")) base::write_file(out, table);
}

}  // namespace
}  // namespace tileflight::tileset::fault_table_test
