"""The suite runs in double precision, with annotations checked at run time."""

import jax
from jaxtyping import install_import_hook

jax.config.update("jax_enable_x64", True)
# Stays on: modules imported later are checked too.
install_import_hook("graded_contact", "typecheck.check")
