// Writes a synthetic run folder and its report, for the checks of the page in a browser: write_synthetic_report DIR
#include <cstdio>
#include <exception>

#include "tests/web/synthetic_run.h"
#include "tileflight/experiments/report/report.h"

int main(int argc, char** argv) {
  if (argc != 2) return std::fputs("usage: write_synthetic_report DIR\n", stderr), 2;
  try {
    tileflight::tests::SyntheticRun(argv[1],
                                    {.name = "Bowl <script>alert('named by a stranger')</script> & co.", .rig = true})
        .write();
    tileflight::report::write_report(argv[1]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
