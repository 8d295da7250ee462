#include <gmock/gmock.h>

#include <fstream>
#include <map>
#include <regex>

#include "tests/source_folder.h"
#include "tileflight/live/airsim/method_table.h"
#include "tileflight/live/simulator/test_world.h"

namespace tileflight::airsim::documented_methods_test {
namespace {

using testing::HasSubstr;

/// A row of a table of docs/server.md.
struct Row {
  std::vector<std::string> methods;
  std::string kind;  ///< works, differs, no effect, refused; own calls: what they give
  std::string text;
  std::string cosys;  ///< what Cosys-AirSim's client gets; own calls: nothing
};

std::vector<std::string> cells_of(const std::string& line) {
  std::vector<std::string> cells;
  std::size_t begin = 1;
  for (std::size_t end = line.find('|', begin); end != std::string::npos; end = line.find('|', begin)) {
    std::string cell = line.substr(begin, end - begin);
    cell.erase(0, cell.find_first_not_of(' '));
    cell.erase(cell.find_last_not_of(' ') + 1);
    cells.push_back(cell);
    begin = end + 1;
  }
  return cells;
}

/// The text from "## Methods" to the next heading of that level.
std::vector<Row> documented() {
  std::ifstream page(tests::source_folder() / "docs/server.md");
  std::vector<Row> rows;
  bool within = false;
  const std::regex name("`([A-Za-z]+)[`(]");
  for (std::string line; std::getline(page, line);) {
    if (line.starts_with("## ")) within = line == "## Methods";
    if (!within || !line.starts_with("| `")) continue;
    const std::vector<std::string> cells = cells_of(line);
    Row row{{}, cells.at(1), cells.size() > 2 ? cells[2] : std::string(), cells.size() > 3 ? cells[3] : std::string()};
    for (std::sregex_iterator at(cells[0].begin(), cells[0].end(), name), end; at != end; ++at)
      row.methods.push_back((*at)[1]);
    rows.push_back(row);
  }
  return rows;
}

class DocumentedMethods : public testing::Test {
 protected:
  std::string error_of(const std::string& method, int arguments) const {
    msgpack::sbuffer buffer;
    msgpack::packer<msgpack::sbuffer> pack(buffer);
    pack.pack_array(4);
    pack.pack(0);
    pack.pack(1);
    pack.pack(method);
    pack.pack_array(static_cast<std::uint32_t>(arguments));
    for (int i = 0; i < arguments; ++i) pack.pack_map(0);
    return table_.call(rpc::Request({buffer.data(), buffer.size()})).error;
  }

  template <class... Arguments>
  std::string error_of_call(const std::string& method, const Arguments&... arguments) const {
    msgpack::sbuffer buffer;
    msgpack::pack(buffer, std::make_tuple(0, 1, method, std::make_tuple(arguments...)));
    return table_.call(rpc::Request({buffer.data(), buffer.size()})).error;
  }

  Levels levels_{simulator::test_world::simulator(simulator::test_world::kComputerVision)};
  rpc::MethodTable table_ = make_method_table(levels_, [] { return rpc::ServerStatistics{}; });
};

TEST_F(DocumentedMethods, AreThoseOfTheServer) {
  std::vector<std::string> names;
  for (const Row& row : documented()) names.insert(names.end(), row.methods.begin(), row.methods.end());
  EXPECT_THAT(names, testing::UnorderedElementsAreArray(table_.names()));
}

TEST_F(DocumentedMethods, AreRefusedWithTheWordsOfThePageAndNoOthersAre) {
  constexpr int kNobodyTakes = 25;  // arguments: what is served is not called
  const std::map<std::string, int> kNothing;
  int refused = 0;
  for (const Row& row : documented()) {
    for (const std::string& method : row.methods) {
      std::string error = error_of(method, kNobodyTakes);
      if (row.kind != "refused") {
        EXPECT_THAT(error, testing::Not(HasSubstr("is not served here"))) << method;
        continue;
      }
      ++refused;
      if (method == "simSpawnObject") error = error_of_call(method, "a", "b", kNothing, kNothing, false, false);
      const std::string before = method + " is not served here: ";
      const std::size_t reason = error.find(before);
      ASSERT_NE(reason, std::string::npos) << method << ": " << error;
      std::string words = error.substr(reason + before.size());
      words.erase(words.find_last_not_of('.') + 1);
      EXPECT_THAT(row.text, HasSubstr(words)) << method;
    }
  }
  EXPECT_GT(refused, 25);
}

TEST_F(DocumentedMethods, SayWhatCosysClientsGet) {
  std::vector<std::string> not_called;
  for (const Row& row : documented()) {
    if (row.methods.front().starts_with("tf")) continue;
    EXPECT_NE(row.cosys, "") << row.methods.front();
    if (row.cosys == "–") not_called.insert(not_called.end(), row.methods.begin(), row.methods.end());
  }
  EXPECT_THAT(not_called, testing::UnorderedElementsAre("simSetLightIntensity", "setSafety", "simGetLidarSegmentation",
                                                        "moveByAngleZ", "moveByAngleThrottle"));
}

TEST_F(DocumentedMethods, WithoutEffectAreAnsweredWhateverTheArguments) {
  for (const Row& row : documented()) {
    if (row.kind != "no effect") continue;
    for (const std::string& method : row.methods) EXPECT_EQ(error_of(method, 3), "") << method;
  }
}

}  // namespace
}  // namespace tileflight::airsim::documented_methods_test
