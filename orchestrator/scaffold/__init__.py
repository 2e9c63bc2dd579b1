"""Files for somebody who brings an idea of their own."""
