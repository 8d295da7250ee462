#include <memory>

#include "command.h"
#include "completion_script.h"

namespace tileflight::app {

void add_completion(CLI::App& app, CommonOptions&, Selection& selection) {
  auto shell = std::make_shared<std::string>();
  CLI::App* command = app.add_subcommand("completion", "script by which a shell completes commands, options and files");
  command->footer(
      "Example:\n  source <(tileflight completion bash)                     # in ~/.bashrc\n"
      "  tileflight completion zsh > ~/.zfunc/_tileflight          # in a folder of zsh's $fpath");
  command->add_option("shell", *shell, "shell to write the script for")
      ->required()
      ->check(CLI::IsMember({"bash", "zsh"}))
      ->option_text("SHELL:{bash,zsh} REQUIRED");
  command->callback([shell, &app, &selection] {
    selection.run = [shell, &app](const CommonOptions&, const Progress&) -> Output {
      return {{}, *shell == "bash" ? bash_completion(app) : zsh_completion(app)};
    };
  });
}

}  // namespace tileflight::app
