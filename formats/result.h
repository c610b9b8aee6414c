// Errors as values: every library function that can fail returns Status or Result<T>.
#pragma once

#include <cstdint>
#include <string>
#include <tl/expected.hpp>
#include <utility>

namespace voxkit {

/// What went wrong, in the classes that the tools turn into exit codes (tools/common/main.cc).
enum class ErrorCode {
  usage,        ///< the caller asked for something that cannot be (exit 2)
  input,        ///< input unreadable, corrupt or unsupported (exit 3)
  output,       ///< output cannot be written, or exists (exit 4)
  limit,        ///< a limit set by the user was reached (exit 5)
  device,       ///< the device asked for is not there (exit 6)
  interrupted,  ///< SIGINT or SIGTERM (exit 130 or 143)
  internal,     ///< a bug of ours (exit 70)
};

/// One line for a person: `file: what is wrong: what was expected`. For a corrupt file `what` names the
/// section, the byte offset and the rule that is broken.
struct Error {
  ErrorCode code = ErrorCode::internal;
  std::string file;  ///< may be empty where the library does not know the name
  std::string what;
};

/// A value, or the error that there is instead. Whoever is handed one looks at it: dropping it is a warning,
/// and here warnings are errors. It is tl::expected in all else, which cannot be told so itself.
template <class T>
class [[nodiscard]] Result : public tl::expected<T, Error> {
 public:
  using tl::expected<T, Error>::expected;
};
/// Nothing, or an error.
using Status = Result<void>;

/// Control characters in `what`, which may quote a file, become '?': a message stays one line and harmless on
/// a terminal.
inline tl::unexpected<Error> fail(ErrorCode code, std::string file, std::string what) {
  for (char& c : what)
    if (static_cast<unsigned char>(c) < ' ' || c == '\x7f') c = '?';
  return tl::unexpected<Error>(Error{code, std::move(file), std::move(what)});
}
inline tl::unexpected<Error> bad_input(std::string file, std::string what) {
  return fail(ErrorCode::input, std::move(file), std::move(what));
}
inline tl::unexpected<Error> bad_usage(std::string what) {
  return fail(ErrorCode::usage, {}, std::move(what));
}

}  // namespace voxkit

#define VOX_CONCAT_(a, b) a##b
#define VOX_CONCAT(a, b) VOX_CONCAT_(a, b)
/// VOX_TRY(auto x, f()): x becomes the value, or the enclosing function returns the error.
#define VOX_TRY(declaration, expression)                                                       \
  auto VOX_CONCAT(vox_try_, __LINE__) = (expression);                                          \
  if (!VOX_CONCAT(vox_try_, __LINE__))                                                         \
    return tl::unexpected<::voxkit::Error>(std::move(VOX_CONCAT(vox_try_, __LINE__)).error()); \
  declaration = std::move(*VOX_CONCAT(vox_try_, __LINE__))
/// VOX_CHECK(f()): the enclosing function returns the error, if there is one.
#define VOX_CHECK(expression)                                                                    \
  if (auto VOX_CONCAT(vox_status_, __LINE__) = (expression); !VOX_CONCAT(vox_status_, __LINE__)) \
  return tl::unexpected<::voxkit::Error>(std::move(VOX_CONCAT(vox_status_, __LINE__)).error())
