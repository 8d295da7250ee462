// All stages from tiles to scores give the same bytes whatever a processor has. Variants of libraries that can be
// forced on one machine stand for other processors.

#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

#include "tests/all_stages.h"
#include "tests/same_files.h"
#include "tests/temporary_folder.h"

namespace tileflight::processors_test {
namespace {

/// Files with times or the machine in them; what they state of the flight stands in the others.
bool holds_times(const std::string& file) {
  for (const char* name : {"report.html", "report.json", "results.json", "dataset.yaml", "odometry.json",
                           "extract.json", "localize.json", ".file-hashes"})
    if (file.ends_with(name)) return true;
  return file.starts_with("run/stages/");
}

/// `differs`: a file that is made but may have other bytes.
void expect_the_usual_bytes(const std::string& program, const std::string& differs = "none") {
  const std::filesystem::path expected = tests::AllStages::usual().made();
  const tests::TemporaryFolder folder;
  tests::AllStages::run(folder.path(), program);
  int compared = 0;
  for (const std::string& file : tests::files_of(folder.path())) {
    if (holds_times(file) || file.ends_with(differs)) continue;
    EXPECT_TRUE(tests::file_text(folder / file) == tests::file_text(expected / file)) << file;
    ++compared;
  }
  EXPECT_GT(compared, 400);
}

struct Variant {
  const char* name;
  const char* environment;
};

class Processors : public testing::TestWithParam<Variant> {};

TEST_P(Processors, GiveTheSameBytes) {
  expect_the_usual_bytes(std::string(GetParam().environment) + " " + tests::shell_quoted(TILEFLIGHT_BINARY));
}

INSTANTIATE_TEST_SUITE_P(
    All, Processors,
    testing::Values(
        // Both spellings of the C library's features: of releases before 2.33 and after.
        Variant{"CLibraryWithoutFusedOperations",
                "GLIBC_TUNABLES=glibc.cpu.hwcaps=-AVX512F,-AVX2,-FMA,-FMA4,-AVX2_Usable,-FMA_Usable"},
        Variant{"JpegWithoutVectors", "JSIMD_FORCENONE=1"}, Variant{"FfmpegWithoutVectors", "TILEFLIGHT_FFMPEG=0"},
        Variant{"OneProcessorAndBlasOfAnOldOne", "OPENBLAS_CORETYPE=Prescott OPENBLAS_NUM_THREADS=1 taskset -c 0"}),
    [](const auto& info) { return std::string(info.param.name); });

/// Another build: for another architecture or system, started as TILEFLIGHT_OTHER_PROGRAM says (docs/trust.md).
TEST(OtherPrograms, GiveTheSameBytes) {
  const char* const program = std::getenv("TILEFLIGHT_OTHER_PROGRAM");
  if (program == nullptr) GTEST_SKIP() << "TILEFLIGHT_OTHER_PROGRAM names no program";
  expect_the_usual_bytes(program, "video.mp4");  // names the encoder and its version
}

}  // namespace
}  // namespace tileflight::processors_test
